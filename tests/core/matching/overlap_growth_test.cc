#include "core/matching/overlap_growth.h"

#include <algorithm>
#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/parallel.h"
#include "core/base/random_stream.h"
#include "tests/support/hashed_test_shape.h"
#include "tests/support/matchers.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

using testing::IsEmpty;
using testing::SizeIs;

/// Points of one shape, of which each side lacks some that the other has.
class OverlapGrowthTest : public testing::Test {
 protected:
  static constexpr int kPoints = 220;

  OverlapGrowthTest() : shape_(FiveArms(3), kPoints) {
    const PointPool& pool = shape_.pool();
    Eigen::MatrixXf all(kPoints, kPoints);
    for (int i = 0; i < kPoints; ++i) {
      for (int j = 0; j < kPoints; ++j) {
        all(i, j) = shape_.basis().LowerBound(pool.vertex(i), pool.vertex(j));
      }
    }
    all /= all.maxCoeff();
    // The part of the shape that each side has, by distance from two points far
    // from each other.
    int far = 0;
    all.col(0).maxCoeff(&far);
    for (int p = 0; p < kPoints; ++p) {
      if (all(p, 0) < 0.75f) points_x_.push_back(p);
      if (all(p, far) < 0.75f) points_y_.push_back(p);
    }
    distances_x_ = all(points_x_, points_x_);
    distances_y_ = all(points_y_, points_y_);
    frames_x_ = Gather(points_x_);
    frames_y_ = Gather(points_y_);
    RandomStream random(3, 0);
    differences_.resize(points_y_.size(), points_x_.size());
    for (Eigen::Index i = 0; i < differences_.size(); ++i) {
      differences_.data()[i] = static_cast<float>(0.5 + random.Unit());
    }
    for (int x = 0; x < size_x(); ++x) {
      const int y = TrueY(x);
      if (y >= 0) differences_(y, x) = 0.1f;
    }
  }

  PointFrames Gather(const std::vector<int>& points) const {
    const PointFrames& all = shape_.frames();
    return {all.positions(points, Eigen::all), all.normals(points, Eigen::all),
            all.curvatures(points)};
  }

  int size_x() const { return static_cast<int>(points_x_.size()); }

  /// -1 where Y lacks the point.
  int TrueY(int x) const {
    const auto found =
        std::find(points_y_.begin(), points_y_.end(), points_x_[x]);
    return found == points_y_.end()
               ? -1
               : static_cast<int>(found - points_y_.begin());
  }

  /// Three points that both have, far from each other, none of the first few.
  Seed RightSeed(int first = 0) const {
    Seed seed;
    for (int x = first; x < size_x() && seed.size() < 3; ++x) {
      const int y = TrueY(x);
      const bool apart =
          std::all_of(seed.begin(), seed.end(), [&](const PointMatch& match) {
            return distances_x_(x, match.x) > 0.15f &&
                   distances_x_(x, match.x) < 0.5f;
          });
      if (y >= 0 && apart) seed.push_back({x, y});
    }
    return seed;
  }

  OverlapGround Ground() const {
    return {differences_, {distances_x_, frames_x_}, {distances_y_, frames_y_}};
  }

  std::vector<GrownOverlap> Grow(const std::vector<Seed>& seeds) const {
    return *GrowOverlaps(Ground(), seeds, options_, {});
  }

  HashedTestShape shape_;
  std::vector<int> points_x_;
  std::vector<int> points_y_;
  Eigen::MatrixXf distances_x_;
  Eigen::MatrixXf distances_y_;
  PointFrames frames_x_;
  PointFrames frames_y_;
  Eigen::MatrixXf differences_;
  OverlapGrowthOptions options_;
};

TEST_F(OverlapGrowthTest, WhatBothHaveGrowsFromThreeMatchesAndTheRestStaysOut) {
  const Seed seed = RightSeed();
  ASSERT_THAT(seed, SizeIs(3));
  const std::vector<GrownOverlap> grown = Grow({seed});
  ASSERT_THAT(grown, SizeIs(1));
  int right = 0;
  for (const auto& [x, y] : grown[0].matches) right += TrueY(x) == y;
  int shared = 0;
  for (int x = 0; x < size_x(); ++x) shared += TrueY(x) >= 0;
  ASSERT_LT(shared, 0.8 * size_x());
  EXPECT_GT(right, 0.9 * shared);
  EXPECT_GT(right, 0.95 * double(grown[0].matches.size()));
}

TEST_F(OverlapGrowthTest, ARightSeedIsWorthMoreThanAWrongOne) {
  Seed wrong = RightSeed();
  for (PointMatch& match : wrong) {
    match.y = (match.y + 11) % static_cast<int>(points_y_.size());
  }
  const std::vector<GrownOverlap> alone = Grow({RightSeed()});
  const std::vector<GrownOverlap> both = Grow({wrong, RightSeed()});
  ASSERT_THAT(both, testing::Not(IsEmpty()));
  EXPECT_EQ(both[0].matches, alone[0].matches);
  EXPECT_EQ(both[0].score, alone[0].score);
}

TEST_F(OverlapGrowthTest, ResultsAreDistinctAndNoMoreThanAsked) {
  Seed other = RightSeed();
  std::rotate(other.begin(), other.begin() + 1, other.end());
  EXPECT_THAT(Grow({RightSeed(), other, RightSeed()}), SizeIs(1));
  options_.max_results = 0;
  EXPECT_THAT(Grow({RightSeed()}), IsEmpty());
}

TEST_F(OverlapGrowthTest, OfSeedsThatBecomeOneTheBestGrowsToTheEnd) {
  std::vector<Seed> seeds;
  std::vector<GrownOverlap> each;
  double best = 0;
  for (int first = 0; first < 60; first += 10) {
    seeds.push_back(RightSeed(first));
    ASSERT_THAT(seeds.back(), SizeIs(3));
    const std::vector<GrownOverlap> alone = Grow({seeds.back()});
    ASSERT_THAT(alone, SizeIs(1));
    best = std::max(best, alone[0].score);
    each.push_back(alone[0]);
  }
  const std::vector<GrownOverlap> all = Grow(seeds);
  ASSERT_THAT(all, SizeIs(1));
  EXPECT_EQ(all[0].score, best);
  options_.distinct_early = true;
  const std::vector<GrownOverlap> grown = Grow(seeds);
  ASSERT_THAT(grown, SizeIs(1));
  EXPECT_GT(grown[0].score, 0.98 * best);
  // It is one of them as that grows alone.
  EXPECT_TRUE(std::ranges::any_of(each, [&](const GrownOverlap& alone) {
    return alone.matches == grown[0].matches && alone.score == grown[0].score;
  }));
}

TEST_F(OverlapGrowthTest, NoTwoPointsKeepOnePlace) {
  // Each point looks most like the place of its nearest neighbor.
  for (int x = 0; x < size_x(); ++x) {
    Eigen::VectorXf distances = distances_x_.col(x);
    distances[x] = 9;
    int nearest = 0;
    distances.minCoeff(&nearest);
    if (TrueY(nearest) >= 0) differences_(TrueY(nearest), x) = 0;
  }
  const std::vector<GrownOverlap> grown = Grow({RightSeed()});
  ASSERT_THAT(grown, SizeIs(1));
  std::vector<int> taken;
  for (const PointMatch& match : grown[0].matches) taken.push_back(match.y);
  std::ranges::sort(taken);
  EXPECT_EQ(std::ranges::adjacent_find(taken), taken.end());
}

TEST_F(OverlapGrowthTest, PinnedMatchesStayWhateverContradictsThem) {
  Seed seed = RightSeed();
  const int x = seed[0].x;
  const int wrong = (seed[0].y + 11) % static_cast<int>(points_y_.size());
  seed.insert(seed.begin(), {x, wrong});
  seed.erase(seed.begin() + 1);
  options_.pinned = 1;
  const std::vector<GrownOverlap> grown = Grow({seed});
  for (const GrownOverlap& one : grown) {
    EXPECT_THAT(one.matches, testing::Contains(PointMatch{x, wrong}));
  }
}

TEST_F(OverlapGrowthTest, TheSameAtAnyThreadCount) {
  const std::vector<Seed> seeds(5, RightSeed());
  std::vector<GrownOverlap> alone;
  std::vector<GrownOverlap> together;
  RunWithThreads(1, [&] { alone = Grow(seeds); });
  RunWithThreads(4, [&] { together = Grow(seeds); });
  ASSERT_EQ(alone.size(), together.size());
  for (std::size_t i = 0; i < alone.size(); ++i) {
    EXPECT_EQ(alone[i].matches, together[i].matches);
    EXPECT_EQ(alone[i].score, together[i].score);
  }
}

TEST_F(OverlapGrowthTest, ItEndsWhenAsked) {
  std::stop_source source;
  source.request_stop();
  EXPECT_THAT(
      GrowOverlaps(Ground(), {RightSeed()}, options_, source.get_token()),
      StatusIs(absl::StatusCode::kCancelled, testing::_));
}

}  // namespace
}  // namespace isomatch
