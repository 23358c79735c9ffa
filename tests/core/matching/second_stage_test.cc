#include "core/matching/second_stage.h"

#include <algorithm>
#include <vector>

#include <gtest/gtest.h>

#include "tests/support/hashed_test_shape.h"
#include "tests/support/matchers.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

/// Every `step`-th vertex matched to itself.
PartialVertexMap Begin(VertexIndex n, VertexIndex m, int step) {
  PartialVertexMap map(n, m);
  for (VertexIndex v = 0; v < std::min(n, m); v += step) map.Set(v, v);
  return map;
}

int CountMatched(const VertexMap& map) {
  int count = 0;
  for (const VertexIndex v : map) count += v != kNoVertex;
  return count;
}

void ExpectInjective(const PartialVertexMap& map) {
  for (std::size_t x = 0; x < map.y_from_x.size(); ++x) {
    const VertexIndex y = map.y_from_x[x];
    if (y == kNoVertex) continue;
    EXPECT_EQ(map.x_from_y[y], static_cast<VertexIndex>(x));
  }
  EXPECT_EQ(CountMatched(map.y_from_x), CountMatched(map.x_from_y));
}

TEST(SecondStageTest, FillsToTheFractionInjectivelyAndNearTheTruth) {
  const HashedTestShape shape(FiveArms(3), /*pool_size=*/50);
  PartialVertexMap map = Begin(642, 642, /*step=*/6);
  RandomStream random(1, 0);
  SecondStageOptions options;
  options.fraction = 0.7;
  ASSERT_THAT(RunSecondStage({shape.hashed(), shape.hashed()}, options, &random,
                             {}, &map),
              IsOk());
  EXPECT_EQ(CountMatched(map.y_from_x), static_cast<int>(0.7 * 642));
  ExpectInjective(map);
  int right = 0;
  for (VertexIndex v = 0; v < 642; ++v) right += map.y_from_x[v] == v;
  EXPECT_GT(right, 0.95 * 0.7 * 642);
}

TEST(SecondStageTest, UsesUpTheSmallerShapeAndNoMore) {
  const HashedTestShape x(FiveArms(3), /*pool_size=*/50);
  const HashedTestShape y(FiveArms(2), /*pool_size=*/50);
  PartialVertexMap map = Begin(642, 162, /*step=*/9);
  RandomStream random(1, 0);
  SecondStageOptions options;
  options.fraction = 1;
  ASSERT_THAT(
      RunSecondStage({x.hashed(), y.hashed()}, options, &random, {}, &map),
      IsOk());
  EXPECT_EQ(CountMatched(map.x_from_y), 162);
  ExpectInjective(map);
}

TEST(SecondStageTest, EnvironmentsGrowUntilACandidateTurnsUp) {
  const HashedTestShape shape(FiveArms(3), /*pool_size=*/50);
  // One match only: most vertices have no matched vertex near them.
  PartialVertexMap map(642, 642);
  map.Set(0, 0);
  RandomStream random(1, 0);
  SecondStageOptions options;
  options.fraction = 0.2;
  ASSERT_THAT(RunSecondStage({shape.hashed(), shape.hashed()}, options, &random,
                             {}, &map),
              IsOk());
  EXPECT_EQ(CountMatched(map.y_from_x), static_cast<int>(0.2 * 642));
}

TEST(SecondStageTest, StopsWhenAsked) {
  const HashedTestShape shape(FiveArms(3), /*pool_size=*/50);
  PartialVertexMap map = Begin(642, 642, /*step=*/6);
  RandomStream random(1, 0);
  std::stop_source stop;
  stop.request_stop();
  EXPECT_THAT(RunSecondStage({shape.hashed(), shape.hashed()}, {}, &random,
                             {.stop = stop.get_token()}, &map),
              StatusIs(absl::StatusCode::kCancelled, testing::_));
}

TEST(MergedEnvironmentTest, IsTheUnionOverTheNearestBasisPoints) {
  const HashedTestShape shape(FiveArms(3), /*pool_size=*/50);
  const std::vector<VertexIndex> merged =
      MergedEnvironment(shape.hashed(), 11, 6);
  EXPECT_TRUE(std::is_sorted(merged.begin(), merged.end()));
  const std::vector<int> nearest = shape.basis().Nearest(11, 6);
  for (VertexIndex v = 0; v < 642; ++v) {
    const std::vector<int> of_v = shape.basis().Nearest(v, 3);
    const bool expected = std::any_of(of_v.begin(), of_v.end(), [&](int z) {
      return std::find(nearest.begin(), nearest.end(), z) != nearest.end();
    });
    EXPECT_EQ(std::binary_search(merged.begin(), merged.end(), v), expected);
  }
}

}  // namespace
}  // namespace isomatch
