#pragma once

#include <cstdint>
#include <stop_token>
#include <vector>

#include "absl/status/statusor.h"
#include "core/base/nearest_columns.h"
#include "core/base/vertex_index.h"
#include "core/descriptor/shot_descriptor.h"

namespace isomatch {

/// Descriptors of some vertices of one surface.
struct ShapeDescriptors {
  std::vector<VertexIndex> vertices;
  /// One a column, in that order.
  PointColumns columns;
  /// Column of each vertex of the surface, -1 without.
  std::vector<int> column_of_vertex;
};

/// Describes up to `count` vertices, chosen evenly by area. As ShotDescriptors.
absl::StatusOr<ShapeDescriptors> DescribeShape(const DescribedSurface& surface,
                                               std::int64_t count,
                                               const ShotBall& ball,
                                               const std::stop_token& stop);

/// A surface with those of its vertices. References must outlive it.
struct DescribedShape {
  const ShapeDescriptors& descriptors;
  const DescribedSurface& surface;
};

/// Directions in which descriptors are compared at first.
inline constexpr int kMainDirections = 48;

/// Two shapes that are compared. References must outlive it.
struct DescribedPair {
  const ShapeDescriptors& x;
  DescribedShape y;
  /// Descriptors in the kMainDirections that they differ most by, and below
  /// them the length of the rest: as near to each other as they are, or nearer.
  PointColumns few_x;
  PointColumns few_y;
};

/// REQUIRES: both have described vertices. CANCELLED after `stop`.
absl::StatusOr<DescribedPair> PairDescriptors(const ShapeDescriptors& x,
                                              const DescribedShape& y,
                                              const std::stop_token& stop);

struct NearbyMatchOptions {
  /// How far from its image a better one is looked for, mesh units of Y.
  double reach = 0.2;
  /// Only one in this many described vertices of X is looked for.
  std::int64_t every = 1;
  /// Weight of the distance, a reach counting as 1, against the squared
  /// difference of descriptors.
  double distance_weight = 0.05;
};

/// Returns for each described vertex of X that options.every takes, of those on
/// Y near where `y_from_x` (dense) sends it, the most alike one; kNoVertex for
/// the others, and where nothing near is described. What is near lies in reach,
/// and edges lead there that stay within a little more than that.
absl::StatusOr<VertexMap> MatchNearby(const DescribedPair& pair,
                                      const VertexMap& y_from_x,
                                      const NearbyMatchOptions& options,
                                      const std::stop_token& stop);

/// Mean squared difference between the descriptors of vertices of X and of
/// their images, 0 to 2, over evenly chosen ones of those described. REQUIRES:
/// `ball` is what x was described with.
absl::StatusOr<double> DescriptorMismatch(const ShapeDescriptors& x,
                                          const DescribedSurface& surface_y,
                                          const VertexMap& y_from_x,
                                          const ShotBall& ball,
                                          const std::stop_token& stop);

}  // namespace isomatch
