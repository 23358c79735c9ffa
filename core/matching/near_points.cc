#include "core/matching/near_points.h"

#include <algorithm>
#include <cstdint>
#include <utility>

#include "core/base/parallel.h"
#include "core/base/status_macros.h"

namespace isomatch {

absl::StatusOr<std::vector<NearPoints>> NearPointsOf(
    const Eigen::MatrixXf& distances, float reach,
    const std::stop_token& stop) {
  std::vector<NearPoints> near(distances.cols());
  ISOMATCH_RETURN_IF_ERROR(
      ParallelFor(distances.cols(), stop, [&](std::int64_t p) {
        std::vector<std::pair<float, int>> found;
        for (int q = 0; q < static_cast<int>(distances.rows()); ++q) {
          if (distances(q, p) <= reach) found.emplace_back(distances(q, p), q);
        }
        std::sort(found.begin(), found.end());
        near[p].distances.reserve(found.size());
        near[p].points.reserve(found.size());
        for (const auto& [distance, q] : found) {
          near[p].distances.push_back(distance);
          near[p].points.push_back(q);
        }
      }));
  return near;
}

}  // namespace isomatch
