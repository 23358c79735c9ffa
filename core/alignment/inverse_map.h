#pragma once

#include <stop_token>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "core/mesh/surface_point.h"
#include "core/mesh/triangle_mesh.h"
#include "core/mesh/vertex_stars.h"

namespace isomatch {

/// A surface and where its vertices lie on another. References must outlive it.
struct LaidSurface {
  const TriangleMesh& mesh;      ///< at rest
  const Eigen::VectorXd& areas;  ///< what each vertex stands for
  const Positions& places;       ///< n x 3, on the other surface
  /// Not 0 for the vertices that lie there, which alone count; empty: all.
  absl::Span<const char> matched;
};

/// The surface that it is laid on. `oriented`: of both, normals mean something.
struct GroundSurface {
  const TriangleMesh& mesh;
  const VertexStars& stars;
  const Eigen::VectorXd& areas;
  const Positions& normals;
  bool oriented = true;
};

/// A map the other way round.
struct InverseMap {
  /// For each vertex of the ground the point of the laid surface next to it.
  std::vector<SurfacePoint> points;
  /// 1 where that point lies over the vertex: not where the nearest point is on
  /// the rim, far away, on the other side of a thin wall, or not matched.
  std::vector<char> covered;
};

/// Inverts a map. CANCELLED after `stop`. Time as NearestOnSurface.
absl::StatusOr<InverseMap> InvertMap(const LaidSurface& laid,
                                     const GroundSurface& ground,
                                     const std::stop_token& stop);

}  // namespace isomatch
