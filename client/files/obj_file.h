#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "absl/status/statusor.h"
#include "client/files/vertex_colors.h"
#include "core/mesh/triangle_mesh.h"

namespace isomatch {

/// Where the faces of a mesh lie in pictures.
struct MeshTexture {
  /// k x 2: coordinates u, v of places in a picture.
  using Places = Eigen::Matrix<double, Eigen::Dynamic, 2, Eigen::RowMajor>;
  Places places;
  /// m x 3: for each corner of each face a row of `places`, -1 for none.
  Faces corners;
  /// Names of materials, and for each face one of them, -1 for none.
  std::vector<std::string> materials;
  std::vector<int> material_of_face;
  /// Files that describe the materials (.mtl), as paths from the current
  /// folder.
  std::vector<std::string> libraries;
};

/// Returns the texture coordinates of an OBJ file; none when it has no `vt`
/// that a face names, or another extension.
///
/// REQUIRES: ReadMesh(path) gave `mesh`. INVALID_ARGUMENT naming file and line:
/// a `vt` that is not two numbers, or a face that names one that is not there.
absl::StatusOr<std::optional<MeshTexture>> ReadObjTexture(
    const std::string& path, const TriangleMesh& mesh);

/// What an OBJ file has beside the mesh; null for nothing.
struct ObjExtras {
  const MeshTexture* texture = nullptr;
  const Colors* colors = nullptr;
};

/// Returns the text of an OBJ file that is to be at `path`, from whose folder
/// the libraries are named. Numbers read back the same; colors are fractions
/// of three digits after `v x y z`.
std::string FormatObj(const std::string& path, const TriangleMesh& mesh,
                      const ObjExtras& extras);

}  // namespace isomatch
