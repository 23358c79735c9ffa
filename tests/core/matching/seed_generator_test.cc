#include "core/matching/seed_generator.h"

#include <algorithm>
#include <set>
#include <vector>

#include <gtest/gtest.h>

#include "tests/support/hashed_test_shape.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

class SeedGeneratorTest : public testing::Test {
 protected:
  const HashedTestShape shape_{FiveArms(3), /*pool_size=*/100};
};

TEST_F(SeedGeneratorTest, GivesBinomialSquaredTimesFactorialSeeds) {
  // (m, k, binom(m, k)^2 k!)
  const int cases[][3] = {
      {4, 3, 96}, {6, 3, 2400}, {5, 2, 200}, {3, 3, 6}, {4, 1, 16}};
  for (const auto& [m, k, count] : cases) {
    const std::vector<Seed> seeds =
        GenerateSeeds(shape_.pool(), shape_.pool(), {m, k, /*max_seeds=*/0});
    EXPECT_EQ(static_cast<int>(seeds.size()), count);
    std::set<std::set<std::pair<int, int>>> distinct;
    for (const Seed& seed : seeds) {
      std::set<int> xs;
      std::set<int> ys;
      std::set<std::pair<int, int>> matches;
      for (const PointMatch& match : seed) {
        EXPECT_LT(std::max(match.x, match.y), m);
        xs.insert(match.x);
        ys.insert(match.y);
        matches.insert({match.x, match.y});
      }
      EXPECT_EQ(static_cast<int>(xs.size()), k);
      EXPECT_EQ(static_cast<int>(ys.size()), k);
      distinct.insert(matches);
    }
    EXPECT_EQ(distinct.size(), seeds.size());
  }
}

TEST_F(SeedGeneratorTest, SeedsThatAgreeInDistanceComeFirst) {
  const std::vector<Seed> seeds =
      GenerateSeeds(shape_.pool(), shape_.pool(), {5, 3, /*max_seeds=*/0});
  // Matched to itself, the ten subsets under the identity agree perfectly.
  for (int i = 0; i < 10; ++i) {
    for (const PointMatch& match : seeds[i]) EXPECT_EQ(match.x, match.y);
  }
}

TEST_F(SeedGeneratorTest, MaxSeedsKeepsTheBest) {
  const auto all = GenerateSeeds(shape_.pool(), shape_.pool(), {5, 3, 0});
  const auto best = GenerateSeeds(shape_.pool(), shape_.pool(), {5, 3, 25});
  ASSERT_EQ(best.size(), 25u);
  EXPECT_TRUE(std::equal(best.begin(), best.end(), all.begin()));
}

TEST_F(SeedGeneratorTest, SmallPoolsCutThePoints) {
  const HashedTestShape small(Tetrahedron(), /*pool_size=*/0);
  EXPECT_EQ(GenerateSeeds(small.pool(), small.pool(), {8, 4, 0}).size(), 24u);
}

}  // namespace
}  // namespace isomatch
