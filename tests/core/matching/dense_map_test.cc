#include "core/matching/dense_map.h"

#include <vector>

#include <gtest/gtest.h>

#include "tests/support/hashed_test_shape.h"
#include "tests/support/matchers.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

class Surface {
 public:
  explicit Surface(const HashedTestShape& shape)
      : shape_(shape),
        stars_(shape.mesh()),
        areas_(Eigen::VectorXd::Ones(shape.mesh().num_vertices())) {}
  DenseMapSurface get() const { return {shape_.closeness(), stars_, areas_}; }

 private:
  const HashedTestShape& shape_;
  const VertexStars stars_;
  const Eigen::VectorXd areas_;
};

TEST(DenseMapTest, RightMatchesOfARelabeledShapeGiveThePermutation) {
  const auto permutation = RandomPermutation(642, /*seed=*/6);
  const HashedTestShape x(FiveArms(3), /*pool_size=*/60);
  const HashedTestShape y(Relabeled(FiveArms(3), permutation), 60);
  std::vector<VertexMatch> matches;
  for (const VertexIndex v : x.pool().vertices()) {
    matches.push_back({v, permutation[v]});
  }
  const auto map =
      DenseMapFromMatches(Surface(x).get(), Surface(y).get(), matches, {});
  ASSERT_THAT(map, IsOk());
  int right = 0;
  for (VertexIndex v = 0; v < 642; ++v) right += (*map)[v] == permutation[v];
  // The two hashes use different basis points, so a few neighbors swap.
  EXPECT_GT(right, 0.9 * 642);
}

TEST(DenseMapTest, StopsWhenAsked) {
  const HashedTestShape x(FiveArms(2), /*pool_size=*/20);
  std::stop_source stop;
  stop.request_stop();
  const std::vector<VertexMatch> matches = {{0, 0}};
  EXPECT_THAT(DenseMapFromMatches(Surface(x).get(), Surface(x).get(), matches,
                                  stop.get_token())
                  .status(),
              StatusIs(absl::StatusCode::kCancelled, testing::_));
}

}  // namespace
}  // namespace isomatch
