#pragma once

#include <stop_token>

#include <Eigen/Core>

#include "absl/status/statusor.h"
#include "core/base/vertex_index.h"

namespace isomatch {

/// One point a column: dimensions x points, so that a point is contiguous.
using PointColumns = Eigen::MatrixXf;

/// Returns for each column of `queries` the nearest column of `points`
/// (Euclidean), ties by smallest index. Brute force over blocks of a matrix
/// product, in single precision, which keeps 3-4 digits more than the
/// descriptors that are compared here mean anything to.
///
/// REQUIRES: equal rows, at least one point. Time O(queries points rows),
/// memory O(points) beyond the arguments. CANCELLED after `stop`.
absl::StatusOr<VertexMap> NearestColumns(const PointColumns& queries,
                                         const PointColumns& points,
                                         const std::stop_token& stop);

}  // namespace isomatch
