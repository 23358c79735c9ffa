#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/mesh/triangle_mesh.h"

namespace isomatch {

/// n x 3: red, green and blue of each vertex, in [0, 1].
using Colors = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;

/// Where the faces of a mesh lie in pictures.
struct MeshTexture {
  /// k x 2: u and v in a picture.
  using Coordinates = Eigen::Matrix<double, Eigen::Dynamic, 2, Eigen::RowMajor>;
  Coordinates coordinates;
  /// m x 3: for each corner of each face a row of `coordinates`, -1 for none.
  Faces corners;
  /// Names of materials, and for each face one of them, -1 for none.
  std::vector<std::string> materials;
  std::vector<int> material_of_face;
  /// Files that describe the materials (.mtl), as paths from the current
  /// folder.
  std::vector<std::string> libraries;
  /// A picture, not decoded: its file's path from the current folder, or "" and
  /// its bytes (PNG, JPEG).
  struct Image {
    std::string path;
    std::string bytes;
  };
  /// Of a glTF file: its pictures, and for each material one of them, -1 for
  /// none. Of others both are empty, and `libraries` name them.
  std::vector<Image> images;
  std::vector<int> image_of_material;
};

/// The meshes that can be read, for texts.
inline constexpr char kMeshFiles[] =
    ".off, .obj, .ply, .stl, .glb, .gltf, .vtk, .vtp or .drc";

/// Their extensions, in lower case, those most used first.
std::vector<std::string> MeshExtensions();

/// A mesh as read from a file, and what else the file has.
struct LoadedMesh {
  TriangleMesh mesh;
  /// What the user should know about it.
  std::vector<std::string> warnings;
  /// What the file has, by number, where `mesh` was welded since.
  std::optional<Faces> faces_before_weld;
  /// E.g. "PLY, binary little endian".
  std::string format;
  /// Colors of the vertices. INVALID_ARGUMENT, naming file and line: some
  /// vertices have one and others not, or one is not a number of 0 or more.
  absl::StatusOr<std::optional<Colors>> colors = std::optional<Colors>();
  /// Texture of the file's faces, from an OBJ file with a `vt` that a face
  /// names, or from a glTF file with TEXCOORD; v counts from below.
  /// INVALID_ARGUMENT, naming file and line: a `vt` that is not two numbers, or
  /// a face that names one that is not there.
  absl::StatusOr<std::optional<MeshTexture>> texture =
      std::optional<MeshTexture>();

  /// For all that numbers faces as the file does: its faces, and the places of
  /// `mesh`.
  TriangleMesh WithFileFaces() const { return {mesh.positions, file_faces()}; }

  const Faces& file_faces() const {
    return faces_before_weld ? *faces_before_weld : mesh.faces;
  }
};

/// Returns the mesh of an OFF, OBJ, PLY (ascii or binary), STL, glTF (.glb,
/// .gltf), VTK (.vtk, .vtp) or Draco file (.drc), known by its extension, after
/// which .gz may stand; "-" is standard input, known by what it has. What gzip
/// packed is unpacked (client/files/input_file.h). The result passes
/// ValidateMesh.
///
/// 1. Vertices keep the file's number and order, those on no face too. STL has
///    no vertices of its own: corners at one position become one vertex, in
///    order of first use, with a warning.
/// 2. Quadrilaterals are cut along their shorter diagonal, larger polygons into
///    a fan around their first corner (right for convex ones), with a warning.
/// 3. Counts in headers are compared with the file's size before anything is
///    allocated for them.
/// 4. Colors of vertices are red, green and blue of a PLY file's vertices,
///    `v x y z r g b` of OBJ, and numbers after the coordinates in OFF (or
///    COFF): bytes, 16-bit numbers or fractions, as the file has them. What is
///    wrong with them or with texture coordinates does not make the mesh wrong.
/// 5. All primitives that a glTF file's scene places are one mesh
///    (client/files/gltf_reader.h); a .gltf file names no others than those
///    below its folder. Of VTK files polygons and strips are read. For Draco
///    see client/files/draco_reader.h.
///
/// Messages begin with `field` and the path, and say what was expected.
/// NOT_FOUND: no such file. INVALID_ARGUMENT: everything else.
absl::StatusOr<LoadedMesh> ReadMesh(const std::string& path,
                                    const std::string& field);

/// The mesh as a server sees it: coordinates in single precision, and of a mesh
/// far from the origin those from SentOriginOf on, as Draco carries them.
/// Vertices that cleaning joins are those that it joins there.
TriangleMesh AsSent(const TriangleMesh& mesh);

/// Writes an OFF, binary PLY or GLB file, by extension, atomically. Coordinates
/// are written so that reading gives the same double (OFF) or the nearest float
/// (PLY, GLB). INVALID_ARGUMENT: another extension; else as
/// WriteFileAtomically.
absl::Status WriteMesh(const std::string& path, const TriangleMesh& mesh);

/// OK when WriteMesh(path) can be expected to succeed.
absl::Status CheckMeshOutput(const std::string& path);

}  // namespace isomatch
