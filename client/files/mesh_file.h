#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/mesh/triangle_mesh.h"

namespace isomatch {

/// A mesh as read from a file, and what the user should know about it.
struct LoadedMesh {
  TriangleMesh mesh;
  std::vector<std::string> warnings;
  /// What the file has, by number; those of `mesh` are others after a weld.
  Faces file_faces;

  /// For all that numbers faces as the file does: its faces, and the places of
  /// `mesh`.
  TriangleMesh WithFileFaces() const { return {mesh.positions, file_faces}; }
};

/// Returns the mesh of an OFF, OBJ, PLY (ascii or binary) or STL file, known by
/// its extension. The result passes ValidateMesh.
///
/// 1. Vertices keep the file's number and order, those on no face too. STL has
///    no vertices of its own: corners at one place become one vertex, in order
///    of first use, with a warning.
/// 2. Quadrilaterals are cut along their shorter diagonal, larger polygons into
///    a fan around their first corner (right for convex ones), with a warning.
/// 3. Counts in headers are compared with the file's size before anything is
///    allocated for them.
///
/// Messages begin with `field` and the path, and say what was expected.
/// NOT_FOUND: no such file. INVALID_ARGUMENT: everything else.
absl::StatusOr<LoadedMesh> ReadMesh(const std::string& path,
                                    const std::string& field);

/// The mesh as a server sees it: coordinates in single precision, and of a mesh
/// far from the origin those from SentOriginOf on, as Draco carries them.
/// Vertices that cleaning joins are those that it joins there.
TriangleMesh AsSent(const TriangleMesh& mesh);

/// Writes an OFF or binary PLY file, by extension, atomically. Coordinates are
/// written so that reading gives the same double (OFF) or the nearest float
/// (PLY). INVALID_ARGUMENT: another extension; else as WriteFileAtomically.
absl::Status WriteMesh(const std::string& path, const TriangleMesh& mesh);

/// OK when WriteMesh(path) can be expected to succeed.
absl::Status CheckMeshOutput(const std::string& path);

}  // namespace isomatch
