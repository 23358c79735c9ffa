#pragma once

#include <stop_token>
#include <vector>

#include <Eigen/Core>

#include "absl/status/statusor.h"

namespace isomatch {

/// Points by distance from one of them.
struct NearPoints {
  std::vector<float> distances;  ///< ascending
  std::vector<int> points;
};

/// Those within `reach`, of each point, itself first; ties by smallest index.
/// `distances`: P x P. Time O(P^2 log P). CANCELLED after `stop`.
absl::StatusOr<std::vector<NearPoints>> NearPointsOf(
    const Eigen::MatrixXf& distances, float reach, const std::stop_token& stop);

}  // namespace isomatch
