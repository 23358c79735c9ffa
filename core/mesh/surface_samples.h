#pragma once

#include <cstdint>
#include <stop_token>
#include <vector>

#include <Eigen/Core>

#include "absl/status/statusor.h"
#include "core/base/nearest_columns.h"
#include "core/base/vertex_index.h"
#include "core/mesh/vertex_stars.h"

namespace isomatch {

/// Vertices at even steps of area, in order of index; all if there are no more
/// than `count`. `areas`: what each vertex stands for.
std::vector<VertexIndex> EvenlyByArea(const Eigen::VectorXd& areas,
                                      std::int64_t count);

/// Samples a side that NearestOnSurface takes.
inline constexpr std::int64_t kSurfaceSamples = 6000;

/// Some vertices of a surface that stand for all.
struct SurfaceSamples {
  std::vector<VertexIndex> vertices;
  /// For each vertex of the surface the sample, by position in `vertices`, that
  /// the fewest edges lead to; -1 where none leads to one.
  std::vector<int> home;
};

/// Samples `count` vertices evenly by area. Time and memory O(n).
SurfaceSamples SampleSurface(const VertexStars& stars,
                             const Eigen::VectorXd& areas, std::int64_t count);

/// A surface with a point of some space at each vertex, one a column.
struct PointsOnSurface {
  const VertexStars& stars;
  const Eigen::VectorXd& areas;
  const PointColumns& columns;
};

/// Returns the vertex of Y to which edges lead downhill, ever nearer to the
/// point of X's `vertex`, from `start`, or from the images in `before` of its
/// neighbors where one is nearer. `before` may be empty.
VertexIndex DescendOverEdges(const PointsOnSurface& x, const PointsOnSurface& y,
                             VertexIndex vertex, VertexIndex start,
                             const VertexMap& before);

/// DescendOverEdges of every vertex, from its own image in `before` and those
/// of its neighbors. CANCELLED after `stop`. Time O(n) for maps that are
/// nearly right.
absl::StatusOr<VertexMap> DescendFromMap(const PointsOnSurface& x,
                                         const PointsOnSurface& y,
                                         const VertexMap& before,
                                         const std::stop_token& stop);

/// Returns for each vertex of X the vertex of Y with the nearest point.
///
/// Up to 10^8 pairs of vertices all are compared. Beyond, samples of both are,
/// and every vertex of X then descends over Y's edges from where its sample
/// went, and once more from where its neighbors arrived: exact where distance
/// has one valley around there, as it has for smooth functions. Time
/// O((n_X + n_Y) rows) with a constant for the samples.
///
/// REQUIRES: equal rows. CANCELLED after `stop`. Deterministic at any thread
/// count.
absl::StatusOr<VertexMap> NearestOnSurface(const PointsOnSurface& x,
                                           const PointsOnSurface& y,
                                           const std::stop_token& stop);

/// The second way of the above, whatever the sizes.
absl::StatusOr<VertexMap> NearestBySamples(const PointsOnSurface& x,
                                           const PointsOnSurface& y,
                                           std::int64_t samples,
                                           const std::stop_token& stop);

}  // namespace isomatch
