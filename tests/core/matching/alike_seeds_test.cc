#include "core/matching/alike_seeds.h"

#include <algorithm>
#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/parallel.h"
#include "core/base/random_stream.h"
#include "tests/support/hashed_test_shape.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

/// A shape with itself, in another unit if a test wants that.
class AlikeSeedsTest : public testing::Test {
 protected:
  static constexpr int kPoints = 150;

  AlikeSeedsTest() : shape_(FiveArms(3), kPoints) {
    options_.points_x = kPoints;
    options_.tries = 4000;
    options_.max_seeds = 60;
    const PointPool& pool = shape_.pool();
    distances_.resize(kPoints, kPoints);
    for (int i = 0; i < kPoints; ++i) {
      for (int j = 0; j < kPoints; ++j) {
        distances_(i, j) =
            shape_.basis().LowerBound(pool.vertex(i), pool.vertex(j));
      }
    }
    // In sqrt(area), as seeds are tried.
    distances_ /= 0.3f * distances_.maxCoeff();
    RandomStream random(3, 0);
    for (int x = 0; x < kPoints; ++x) {
      for (int y = 0; y < kPoints; ++y) {
        differences_(y, x) = static_cast<float>(0.5 + random.Unit());
      }
      // A point looks like its partner, but not more than like some others.
      differences_(x, x) = 0.52f;
    }
  }

  SupportedSeeds Find(float scale = 1) {
    const Eigen::MatrixXf distances_x = scale * distances_;
    return *AlikeSeeds(differences_, {distances_x, shape_.frames()},
                       {distances_, shape_.frames()}, options_, {});
  }

  static double RightOf(const std::vector<Seed>& seeds) {
    int right = 0;
    for (const Seed& seed : seeds) {
      right += std::all_of(seed.begin(), seed.end(),
                           [](const PointMatch& m) { return m.x == m.y; });
    }
    return double(right) / double(seeds.size());
  }

  HashedTestShape shape_;
  AlikeSeedOptions options_;
  Eigen::MatrixXf distances_;
  Eigen::MatrixXf differences_ = Eigen::MatrixXf(kPoints, kPoints);
};

TEST_F(AlikeSeedsTest, TheBestAgreeInDistancesWithManyOtherPoints) {
  const std::vector<Seed> seeds = Find().seeds;
  ASSERT_GE(seeds.size(), 20u);
  EXPECT_GT(RightOf({seeds.begin(), seeds.begin() + 10}), 0.85);
  for (const Seed& seed : seeds) {
    ASSERT_EQ(seed.size(), 3u);
    for (int a = 0; a < 3; ++a) {
      const PointMatch& one = seed[a];
      const PointMatch& other = seed[(a + 1) % 3];
      EXPECT_NE(one.x, other.x);
      EXPECT_NE(one.y, other.y);
      EXPECT_NEAR(distances_(one.x, other.x), distances_(one.y, other.y), 0.11);
    }
  }
}

TEST_F(AlikeSeedsTest, NoTwoShareTwoMatches) {
  const std::vector<Seed> seeds = Find().seeds;
  for (std::size_t i = 0; i < seeds.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      int same = 0;
      for (const PointMatch& match : seeds[i]) {
        same += static_cast<int>(
            std::count(seeds[j].begin(), seeds[j].end(), match));
      }
      EXPECT_LT(same, 2);
    }
  }
}

TEST_F(AlikeSeedsTest, SupportIsLargestInOneUnitAndTheRatioLeadsThere) {
  const SupportedSeeds same = Find(1);
  EXPECT_NEAR(same.ratio, 1, 0.01);
  for (const float scale : {0.7f, 0.85f, 1.2f, 1.4f}) {
    EXPECT_LT(Find(scale).support, 0.9 * same.support) << scale;
  }
  EXPECT_GT(Find(0.95f).ratio, 1.02);
  EXPECT_LT(Find(1.05f).ratio, 0.98);
}

TEST_F(AlikeSeedsTest, TheSameAtAnyThreadCount) {
  std::vector<Seed> alone;
  std::vector<Seed> together;
  RunWithThreads(1, [&] { alone = Find().seeds; });
  RunWithThreads(4, [&] { together = Find().seeds; });
  EXPECT_EQ(alone, together);
}

TEST_F(AlikeSeedsTest, WithoutThreePointsThatAgreeThereAreNone) {
  const SupportedSeeds found = Find(30);
  EXPECT_TRUE(found.seeds.empty());
  EXPECT_EQ(found.support, 0);
}

}  // namespace
}  // namespace isomatch
