#include "core/matching/closeness.h"

#include <algorithm>
#include <numeric>
#include <vector>

#include <gtest/gtest.h>

#include "core/matching/annealing.h"
#include "core/matching/matching.h"
#include "tests/support/hashed_test_shape.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

TEST(PointPoolTest, NearestAreTheFirstOfAFullSort) {
  const HashedTestShape shape(FiveArms(3), /*pool_size=*/200);
  const PointPool& pool = shape.pool();
  std::vector<float> storage;
  for (const int point : {0, 7, 199}) {
    const float* row = pool.Row(point, &storage);
    std::vector<int> all(pool.size());
    std::iota(all.begin(), all.end(), 0);
    std::stable_sort(all.begin(), all.end(),
                     [&](int a, int b) { return row[a] > row[b]; });
    all.erase(std::find(all.begin(), all.end(), point));
    all.resize(PointPool::kNearest);
    const auto nearest = pool.Nearest(point);
    EXPECT_EQ(std::vector<int>(nearest.begin(), nearest.end()), all);
  }
}

TEST(ClosenessRowsTest, AreTheSameBitsAsRowsOneByOne) {
  const HashedTestShape shape(FiveArms(3), /*pool_size=*/200);
  const std::vector<VertexIndex>& all = shape.pool().vertices();
  // Less than a block, one, and more.
  for (const std::size_t count : {1, 63, 64, 65, 200}) {
    const auto vertices = absl::MakeConstSpan(all).first(count);
    const ClosenessRows rows(shape.closeness(), vertices);
    std::vector<float> row(count);
    std::vector<float> expected(count);
    for (const VertexIndex u : {all[5], VertexIndex{0}, all[150]}) {
      rows.Row(u, row.data());
      shape.closeness().Row(u, vertices, expected.data());
      EXPECT_EQ(row, expected) << count;
    }
  }
}

TEST(PointPoolTest, OnePointHasNoneNear) {
  const HashedTestShape shape(FiveArms(1), /*pool_size=*/20);
  PointPool pool = *PointPool::Create(shape.closeness(), {3}, {});
  ASSERT_TRUE(pool.ListNearest({}).ok());
  EXPECT_TRUE(pool.Nearest(0).empty());
}

TEST(ClosestOfTest, LeavesItselfOutAndTakesTiesInOrder) {
  const std::vector<float> closeness = {0.5f, 1, 0.25f, 0.5f, 0.75f};
  EXPECT_EQ(ClosestOf(closeness.data(), 5, /*self=*/1, 3),
            (std::vector<int>{4, 0, 3}));
  EXPECT_EQ(ClosestOf(closeness.data(), 5, /*self=*/4, 9),
            (std::vector<int>{1, 0, 3, 2}));
}

TEST(RelocationTest, LooksBeyondTheTableInACrowd) {
  // All points of Y but one are taken, so no list of near ones holds it.
  const HashedTestShape shape(FiveArms(3), /*pool_size=*/200);
  Matching matching(shape.pool(), shape.pool(), 199);
  // The last points change places: one stands where another belongs.
  for (int p = 0; p < 198; ++p) matching.Add({p, p});
  matching.Add({198, 199});
  EXPECT_GE(RelocationSweep(/*neighbors=*/1, &matching), 1);
  EXPECT_TRUE(matching.is_matched(kY, 198));
  EXPECT_FALSE(matching.is_matched(kY, 199));
}

}  // namespace
}  // namespace isomatch
