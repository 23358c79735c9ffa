#pragma once

#include <stop_token>
#include <vector>

#include <Eigen/Core>

#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "core/base/vertex_index.h"
#include "core/descriptor/shot_descriptor.h"

namespace isomatch {

/// SHOT descriptors of some points of a surface, one set for each radius.
struct PointDescriptors {
  std::vector<PointColumns> columns;
  /// radii x points: how far to trust each, 0 to 1. A ball that the rim cuts
  /// counts less: on the other shape there may be more.
  Eigen::MatrixXf trust;
};

/// Describes `vertices` by each of `balls`. `rim_distances`: of
/// every vertex of the surface, mesh units. CANCELLED after `stop`.
absl::StatusOr<PointDescriptors> DescribePoints(
    const DescribedSurface& surface, absl::Span<const VertexIndex> vertices,
    absl::Span<const float> rim_distances, absl::Span<const ShotBall> balls,
    const std::stop_token& stop);

/// Returns how unlike points of Y (rows) and of X (columns) are: the squared
/// difference of their descriptors, 0 to 2, averaged over the radii by the
/// trust in those of X. REQUIRES: equally many radii.
Eigen::MatrixXf PointDifferences(const PointDescriptors& x,
                                 const PointDescriptors& y);

}  // namespace isomatch
