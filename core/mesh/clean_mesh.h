#pragma once

#include <stop_token>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/mesh/triangle_mesh.h"

namespace isomatch {

/// A mesh made fit for geometry, and the way back to the user's numbering.
struct CleanMesh {
  /// Every vertex lies on a face, no two vertices of a seam coincide, no face
  /// repeats a vertex or another face; faces agree in orientation with their
  /// neighbors and point outwards (each component encloses a positive volume).
  TriangleMesh mesh;
  /// Clean vertex of each original one; kNoVertex for one on no face.
  VertexMap clean_from_original;
  /// One original vertex, the smallest, of each clean vertex.
  VertexMap original_from_clean;
  /// False when some patch of faces that hang together over manifold edges has
  /// no consistent orientation, as a Moebius strip.
  bool oriented = true;
  /// What was found and mended, in words for the user.
  std::vector<std::string> warnings;
};

/// Returns `mesh` cleaned: boundary vertices of equal coordinates become one
/// (triangle soups, texture seams), faces that repeat a vertex or another face
/// go, vertices on no face go, orientation is made consistent by flood fill
/// over manifold edges and outward by signed volume.
///
/// Properties: (1) idempotent; (2) surface area is kept unless faces repeat;
/// (3) does not depend on the scale of the coordinates.
///
/// REQUIRES: ValidateMesh(mesh). CANCELLED after `stop`. Time O(n log n).
absl::StatusOr<CleanMesh> Clean(const TriangleMesh& mesh,
                                const std::stop_token& stop);
/// The same, never cancelled.
CleanMesh Clean(const TriangleMesh& mesh);

/// The same but for the numbering: a mesh that no cache holds has its vertices
/// in SpatialOrder, and faces by their first vertex. Files have them in any
/// order, and with random ones cleaning takes three times as long.
absl::StatusOr<CleanMesh> CleanInSpatialOrder(const TriangleMesh& mesh,
                                              const std::stop_token& stop);

}  // namespace isomatch
