#include "core/matching/final_swapping.h"

#include <utility>

#include <gtest/gtest.h>

#include "tests/support/hashed_test_shape.h"
#include "tests/support/matchers.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

class FinalSwappingTest : public testing::Test {
 protected:
  FinalSwappingTest() : shape_(FiveArms(3), /*pool_size=*/50), map_(642, 642) {
    for (VertexIndex v = 0; v < 642; ++v) map_.Set(v, v);
  }

  void Exchange(VertexIndex a, VertexIndex b) {
    const VertexIndex y = map_.y_from_x[a];
    map_.Set(a, map_.y_from_x[b]);
    map_.Set(b, y);
  }

  /// A vertex and the one nearest to it.
  std::pair<VertexIndex, VertexIndex> NearPair(VertexIndex v) const {
    VertexIndex nearest = kNoVertex;
    for (VertexIndex u = 0; u < 642; ++u) {
      if (u == v) continue;
      if (nearest == kNoVertex ||
          shape_.closeness()(v, u) > shape_.closeness()(v, nearest)) {
        nearest = u;
      }
    }
    return {v, nearest};
  }

  double Total() const {
    double total = 0;
    for (VertexIndex v = 0; v < 642; ++v) {
      total += Contribution(shape_.hashed(), shape_.hashed(), map_, v);
    }
    return total;
  }

  HashedTestShape shape_;
  PartialVertexMap map_;
};

TEST_F(FinalSwappingTest, ContributionIsThatOfEq9) {
  Exchange(3, 200);
  const VertexIndex x = 50;
  double expected = 0;
  for (const VertexIndex v : MergedEnvironment(shape_.hashed(), x, 3)) {
    if (v == x) continue;
    expected += shape_.closeness()(x, v) *
                shape_.closeness()(map_.y_from_x[x], map_.y_from_x[v]);
  }
  EXPECT_NEAR(Contribution(shape_.hashed(), shape_.hashed(), map_, x), expected,
              1e-4);
}

TEST_F(FinalSwappingTest, ExchangedVerticesFindBack) {
  // Tips of arms contribute little to begin with.
  for (int tip = 0; tip < 3; ++tip) {
    const VertexIndex v = shape_.pool().vertex(tip);
    const auto [a, b] = NearPair(v);
    Exchange(a, b);
  }
  const double broken = Total();
  // The exchanged vertices are among the 2 % that contribute least.
  ASSERT_THAT(
      SwapWorst({shape_.hashed(), shape_.hashed()}, /*fraction=*/1, {}, &map_),
      IsOk());
  EXPECT_GT(Total(), broken);
  int wrong = 0;
  for (VertexIndex v = 0; v < 642; ++v) wrong += map_.y_from_x[v] != v;
  EXPECT_EQ(wrong, 0);
}

TEST_F(FinalSwappingTest, NoCandidatesNoChange) {
  const auto [a, b] = NearPair(10);
  Exchange(a, b);
  const VertexMap before = map_.y_from_x;
  ASSERT_THAT(
      SwapWorst({shape_.hashed(), shape_.hashed()}, /*fraction=*/0, {}, &map_),
      IsOk());
  EXPECT_EQ(map_.y_from_x, before);
}

TEST_F(FinalSwappingTest, StaysAPermutation) {
  for (VertexIndex v = 0; v + 40 < 642; v += 5) Exchange(v, v + 40);
  ASSERT_THAT(SwapWorst({shape_.hashed(), shape_.hashed()}, /*fraction=*/0.5,
                        {}, &map_),
              IsOk());
  for (VertexIndex v = 0; v < 642; ++v) {
    EXPECT_EQ(map_.x_from_y[map_.y_from_x[v]], v);
  }
}

TEST_F(FinalSwappingTest, StopsWhenAsked) {
  std::stop_source stop;
  stop.request_stop();
  EXPECT_THAT(SwapWorst({shape_.hashed(), shape_.hashed()}, 0.5,
                        {.stop = stop.get_token()}, &map_),
              StatusIs(absl::StatusCode::kCancelled, testing::_));
}

}  // namespace
}  // namespace isomatch
