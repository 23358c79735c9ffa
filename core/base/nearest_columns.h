#pragma once

#include <stop_token>

#include <Eigen/Core>

#include "absl/status/statusor.h"
#include "core/base/vertex_index.h"

namespace isomatch {

/// One point a column: dimensions x points, so that a point is contiguous.
using PointColumns = Eigen::MatrixXf;

/// Returns for each column of `queries` the nearest column of `points`
/// (Euclidean), ties to rounding by smallest index. By matrix products in
/// single precision, which keeps 3-4 digits more than the descriptors that are
/// compared here mean anything to. Points that follow each other and lie close
/// together, as those of vertices in spatial order do, are passed over together
/// where they cannot be nearest.
///
/// REQUIRES: equal rows, at least one point. Time O(queries points rows) at
/// most, memory O(points rows / 8) beyond the arguments. CANCELLED after
/// `stop`.
absl::StatusOr<VertexMap> NearestColumns(const PointColumns& queries,
                                         const PointColumns& points,
                                         const std::stop_token& stop);

}  // namespace isomatch
