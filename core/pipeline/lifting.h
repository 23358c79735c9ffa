#pragma once

#include <stop_token>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "core/base/vertex_index.h"
#include "core/mesh/surface_point.h"
#include "core/pipeline/prepared_mesh.h"

namespace isomatch {

/// A map from all full vertices of X to places on the full surface of Y.
struct LiftedMap {
  VertexMap y_from_x;                ///< the vertex next to the place
  std::vector<SurfacePoint> points;  ///< on Y
};

/// Carries a map between solved vertices over to the full meshes: each vertex
/// of X goes where its place on the solved surface goes, as far beside it along
/// the normal as it lies there, and from there to the next place on Y that
/// looks the same way. `points`: for each solved vertex of X a point of Y's
/// solved surface. `landmarks`, between full vertices, are met, and what lies
/// around them moves with them.
///
/// Deterministic at any thread count. CANCELLED after `stop`. Time O(n) for
/// maps that are nearly right.
absl::StatusOr<LiftedMap> LiftMap(const PreparedMesh& x, const PreparedMesh& y,
                                  const std::vector<SurfacePoint>& points,
                                  absl::Span<const VertexMatch> landmarks,
                                  const std::stop_token& stop);

/// The vertices of a dense map as points of `mesh`.
std::vector<SurfacePoint> PointsAtVertices(const WorkingMesh& mesh,
                                           const VertexMap& vertices);

}  // namespace isomatch
