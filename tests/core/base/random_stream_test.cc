#include "core/base/random_stream.h"

#include <vector>

#include <gtest/gtest.h>

namespace isomatch {
namespace {

TEST(RandomStreamTest, SameSeedAndIndexGiveTheSameNumbers) {
  RandomStream a(7, 3);
  RandomStream b(7, 3);
  for (int i = 0; i < 100; ++i) EXPECT_EQ(a.Below(1000), b.Below(1000));
}

TEST(RandomStreamTest, StreamsDifferByIndexAndBySeed) {
  RandomStream a(7, 3);
  RandomStream other_index(7, 4);
  RandomStream other_seed(8, 3);
  const double first = a.Unit();
  EXPECT_NE(first, other_index.Unit());
  EXPECT_NE(first, other_seed.Unit());
}

TEST(RandomStreamTest, BelowIsUniform) {
  RandomStream random(1, 0);
  std::vector<int> counts(10, 0);
  constexpr int kDraws = 100000;
  for (int i = 0; i < kDraws; ++i) ++counts.at(random.Below(10));
  // Five standard deviations of a binomial count.
  for (const int count : counts) EXPECT_NEAR(count, kDraws / 10, 475);
}

TEST(RandomStreamTest, UnitStaysInTheHalfOpenInterval) {
  RandomStream random(1, 0);
  double sum = 0;
  for (int i = 0; i < 10000; ++i) {
    const double value = random.Unit();
    ASSERT_GE(value, 0);
    ASSERT_LT(value, 1);
    sum += value;
  }
  EXPECT_NEAR(sum / 10000, 0.5, 0.015);
}

}  // namespace
}  // namespace isomatch
