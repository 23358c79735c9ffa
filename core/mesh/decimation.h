#pragma once

#include <stop_token>

#include "absl/status/statusor.h"
#include "core/mesh/triangle_mesh.h"

namespace isomatch {

/// A mesh on some of the vertices of a finer one.
struct CoarseMesh {
  TriangleMesh mesh;
  /// The finer mesh's vertex of each; increasing.
  VertexMap fine_from_coarse;
};

/// Returns `mesh` with edges collapsed where that changes the surface least
/// (Garland, Heckbert: Surface Simplification Using Quadric Error Metrics,
/// 1997; by meshoptimizer) until about `target` vertices are left: more where
/// non-manifold edges or many small components forbid it. Vertices stay where
/// they are. The result may need cleaning.
///
/// Where a fifth more would be left, the reason may be many small holes, each
/// of which keeps three vertices, or fins, faces on an edge that has two: then
/// the result has no fins, and no holes but those whose rim is longer than
/// about four of its edges.
///
/// Meshes of more than 131,072 faces are decimated patch by patch at first,
/// each of faces that follow each other, which is quicker where these lie near
/// each other.
///
/// REQUIRES: `mesh` is clean, of at most 10^9 vertices. CANCELLED after `stop`.
/// Deterministic at any thread count. Time O(n log n), memory about 250 bytes a
/// vertex.
absl::StatusOr<CoarseMesh> Decimate(const TriangleMesh& mesh,
                                    VertexIndex target,
                                    const std::stop_token& stop);
}  // namespace isomatch
