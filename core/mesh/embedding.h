#pragma once

#include <stop_token>
#include <vector>

#include "absl/status/statusor.h"
#include "core/mesh/surface_point.h"
#include "core/mesh/triangle_mesh.h"
#include "core/mesh/vertex_stars.h"

namespace isomatch {

/// A mesh and its stars. References must outlive it.
struct StarredMesh {
  const TriangleMesh& mesh;
  const VertexStars& stars;
};

/// Each vertex as a corner of one of its own faces.
/// REQUIRES: every vertex is on one.
std::vector<SurfacePoint> EmbedInItself(const StarredMesh& surface);

/// A mesh of some vertices of a finer one. References must outlive it.
struct CoarseSurface {
  const Faces& faces;
  const VertexStars& stars;
  const VertexMap& fine_from_coarse;
};

/// Finds for each vertex of `fine` the nearest point of a coarse mesh, on its
/// faces, around it; `starts` are coarse vertices near the fine ones. CANCELLED
/// after `stop`. Time O(n).
absl::StatusOr<std::vector<SurfacePoint>> EmbedInCoarse(
    const StarredMesh& fine, const CoarseSurface& coarse,
    const VertexMap& starts, const std::stop_token& stop);

/// For each fine vertex the coarse one that the fewest edges lead to;
/// kNoVertex where none does. Time O(n).
VertexMap NearestByEdges(const VertexStars& fine_stars, VertexIndex num_fine,
                         const VertexMap& fine_from_coarse);

}  // namespace isomatch
