#include "core/matching/near_points.h"

#include <cmath>
#include <cstddef>
#include <iterator>
#include <stop_token>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/matchers.h"

namespace isomatch {
namespace {

TEST(NearPointsTest, AreAllInReachByDistance) {
  // Of points at even places of a line, so that many distances are equal.
  constexpr int kPoints = 40;
  Eigen::MatrixXf distances(kPoints, kPoints);
  for (int p = 0; p < kPoints; ++p) {
    for (int q = 0; q < kPoints; ++q) {
      distances(p, q) = static_cast<float>(std::abs(p * 7 % 40 - q * 7 % 40));
    }
  }
  const auto near = NearPointsOf(distances, 5, {});
  ASSERT_THAT(near, IsOk());
  ASSERT_EQ(near->size(), std::size_t{kPoints});
  for (int p = 0; p < kPoints; ++p) {
    const auto& [found, points] = (*near)[p];
    ASSERT_EQ(found.size(), points.size());
    EXPECT_EQ(std::ssize(points), (distances.col(p).array() <= 5).count());
    EXPECT_EQ(points[0], p);
    for (std::size_t i = 0; i < points.size(); ++i) {
      EXPECT_EQ(found[i], distances(points[i], p));
      if (i == 0) continue;
      EXPECT_GE(found[i], found[i - 1]);
      if (found[i] == found[i - 1]) {
        EXPECT_GT(points[i], points[i - 1]);
      }
    }
  }
}

TEST(NearPointsTest, AStopIsHeard) {
  std::stop_source stop;
  stop.request_stop();
  EXPECT_THAT(
      NearPointsOf(Eigen::MatrixXf::Zero(9, 9), 1, stop.get_token()).status(),
      StatusIs(absl::StatusCode::kCancelled, testing::_));
}

}  // namespace
}  // namespace isomatch
