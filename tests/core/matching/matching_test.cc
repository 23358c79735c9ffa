#include "core/matching/matching.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "core/base/random_stream.h"
#include "core/matching/objective.h"
#include "tests/support/brute_force.h"
#include "tests/support/hashed_test_shape.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

/// Sums of some 50 x 50 single-precision terms.
constexpr double kRounding = 2e-3;

class MatchingTest : public testing::TestWithParam<int> {
 protected:
  MatchingTest()
      : x_(FiveArms(3), GetParam()),
        y_(BumpySphere(3), GetParam()),
        matching_(x_.pool(), y_.pool(), 60) {}

  int RandomUnmatched(Side side) {
    int point = random_.Below(matching_.pool(side).size());
    while (matching_.is_matched(side, point)) {
      point = random_.Below(matching_.pool(side).size());
    }
    return point;
  }

  void AddRandom(int count) {
    for (int i = 0; i < count; ++i) {
      const int x = RandomUnmatched(kX);
      matching_.Add({x, RandomUnmatched(kY)});
    }
  }

  double Expected() const {
    return BruteForceEnergy(x_.pool(), y_.pool(), matching_.Matches());
  }

  HashedTestShape x_;
  HashedTestShape y_;
  Matching matching_;
  RandomStream random_{1, 0};
};

TEST_P(MatchingTest, EnergyAndObjectiveAreThoseOfTheFormulas) {
  AddRandom(40);
  EXPECT_NEAR(matching_.Energy(), Expected(), kRounding);
  EXPECT_NEAR(EmbeddingError(matching_), Expected() / (40 * 39), 1e-6);
  EXPECT_NEAR(Objective(matching_),
              BruteForceObjective(x_.pool(), y_.pool(), matching_.Matches()),
              1e-6);
}

TEST_P(MatchingTest, ChangesAreThoseOfAFullEvaluation) {
  AddRandom(50);
  for (int step = 0; step < 200; ++step) {
    const double before = Expected();
    const int i = random_.Below(50);
    double change;
    if (step % 2 == 0) {
      const int j = (i + 1 + random_.Below(49)) % 50;
      change = matching_.SwapChange(i, j);
      matching_.Swap(i, j);
    } else {
      const int y = RandomUnmatched(kY);
      std::vector<float> changes;
      matching_.RelocateChanges(i, {RandomUnmatched(kY), y}, &changes);
      change = changes[1];
      matching_.Relocate(i, y);
    }
    ASSERT_NEAR(change, Expected() - before, kRounding) << "step " << step;
    ASSERT_NEAR(matching_.Energy(), Expected(), kRounding) << "step " << step;
  }
}

TEST_P(MatchingTest, NearestOnXAreTheFirstOfAFullSort) {
  constexpr int kCount = 7;
  for (const int added : {2, 1, 3, 20, 1, 33}) {
    AddRandom(added);
    matching_.ListNearestOnX(kCount);
    matching_.Swap(0, matching_.size() - 1);  // which changes nothing on X
    for (int i = 0; i < matching_.size(); ++i) {
      std::vector<int> others;
      for (int j = 0; j < matching_.size(); ++j) {
        if (j != i) others.push_back(j);
      }
      std::stable_sort(others.begin(), others.end(), [&](int a, int b) {
        return matching_.closeness(kX, i, a) > matching_.closeness(kX, i, b);
      });
      others.resize(std::min<std::size_t>(kCount, others.size()));
      const auto near = matching_.NearestOnX(i);
      EXPECT_EQ(std::vector<int>(near.begin(), near.end()), others);
    }
  }
  matching_.ListNearestOnX(kCount + 1);
  EXPECT_EQ(matching_.NearestOnX(3).size(), kCount + 1);
}

TEST_P(MatchingTest, CostsOfSingleMatchesCountInAllOfThem) {
  RandomStream random(2, 0);
  Eigen::MatrixXf costs(y_.pool().size(), x_.pool().size());
  for (float& cost : costs.reshaped()) cost = static_cast<float>(random.Unit());
  const PointCosts point_costs = {costs, 0.2f};
  Matching matching(x_.pool(), y_.pool(), 60, &point_costs);
  const auto expected = [&] {
    double sum = BruteForceEnergy(x_.pool(), y_.pool(), matching.Matches());
    for (const PointMatch& match : matching.Matches()) {
      sum += (matching.size() - 1) * 0.2 * costs(match.y, match.x);
    }
    return sum;
  };
  while (matching.size() < 40) {
    const int x = RandomUnmatched(kX);
    const int y = RandomUnmatched(kY);
    if (matching.is_matched(kX, x) || matching.is_matched(kY, y)) continue;
    std::vector<float> all;
    matching.EmbeddingErrors(kX, x, &all);
    std::vector<float> from_y;
    matching.EmbeddingErrors(kY, y, std::vector<int>{x}, &from_y);
    EXPECT_NEAR(all[y], from_y[0], 1e-4);
    double error = 0.5 * matching.size() * 0.2 * costs(y, x);
    for (const PointMatch& match : matching.Matches()) {
      error += std::abs(
          x_.closeness()(x_.pool().vertex(x), x_.pool().vertex(match.x)) -
          y_.closeness()(y_.pool().vertex(y), y_.pool().vertex(match.y)));
    }
    EXPECT_NEAR(all[y], error, 1e-4);
    matching.Add({x, y});
  }
  EXPECT_NEAR(matching.Energy(), expected(), kRounding);
  for (int step = 0; step < 100; ++step) {
    const double before = expected();
    const int i = random_.Below(40);
    double change = 0;
    if (step % 2 == 0) {
      const int j = (i + 1 + random_.Below(39)) % 40;
      change = matching.SwapChange(i, j);
      matching.Swap(i, j);
    } else {
      int y = random_.Below(y_.pool().size());
      while (matching.is_matched(kY, y)) y = random_.Below(y_.pool().size());
      std::vector<float> changes;
      matching.RelocateChanges(i, {y}, &changes);
      change = changes[0];
      matching.Relocate(i, y);
    }
    ASSERT_NEAR(change, expected() - before, kRounding) << "step " << step;
  }
}

TEST_P(MatchingTest, StaysInjectiveAndKnowsWhatIsMatched) {
  AddRandom(50);
  for (int step = 0; step < 100; ++step) {
    matching_.Relocate(random_.Below(50), RandomUnmatched(kY));
    matching_.Swap(step % 50, (step + 7) % 50);
  }
  for (const Side side : {kX, kY}) {
    std::vector<int> count(matching_.pool(side).size(), 0);
    for (int i = 0; i < matching_.size(); ++i) {
      ++count[matching_.point(side, i)];
    }
    for (std::size_t p = 0; p < count.size(); ++p) {
      EXPECT_EQ(count[p], matching_.is_matched(side, p) ? 1 : 0);
    }
  }
}

TEST_P(MatchingTest, EmbeddingErrorsAreThoseOfEq8) {
  AddRandom(30);
  const int x = RandomUnmatched(kX);
  std::vector<float> all;
  matching_.EmbeddingErrors(kX, x, &all);
  ASSERT_EQ(static_cast<int>(all.size()), y_.pool().size());
  const std::vector<int> some = {3, 0, 40};
  std::vector<float> errors;
  matching_.EmbeddingErrors(kX, x, some, &errors);
  for (std::size_t c = 0; c < some.size(); ++c) {
    double expected = 0;
    for (const PointMatch& match : matching_.Matches()) {
      expected += std::abs(
          x_.closeness()(x_.pool().vertex(x), x_.pool().vertex(match.x)) -
          y_.closeness()(y_.pool().vertex(some[c]), y_.pool().vertex(match.y)));
    }
    EXPECT_NEAR(errors[c], expected, 1e-4);
    EXPECT_NEAR(all[some[c]], expected, 1e-4);
  }
}

TEST_P(MatchingTest, FarthestUnmatchedIsLeastCloseToAllMatches) {
  AddRandom(20);
  for (const Side side : {kX, kY}) {
    const PointPool& pool = matching_.pool(side);
    const auto nearest_match = [&](int p) {
      float most = 0;
      for (int i = 0; i < matching_.size(); ++i) {
        most = std::max(
            most, pool.closeness()(pool.vertex(p),
                                   pool.vertex(matching_.point(side, i))));
      }
      return most;
    };
    const float least = nearest_match(matching_.FarthestUnmatched(side));
    for (int p = 0; p < pool.size(); ++p) {
      if (!matching_.is_matched(side, p)) {
        EXPECT_GE(nearest_match(p), least - 1e-6);
      }
    }
  }
}

TEST_P(MatchingTest, NoPointIsLeftWhenAllAreMatched) {
  const HashedTestShape small(Tetrahedron(), GetParam());
  Matching matching(small.pool(), small.pool(), 4);
  for (int p = 0; p < 4; ++p) matching.Add({p, p});
  EXPECT_EQ(matching.FarthestUnmatched(kX), -1);
  EXPECT_NEAR(matching.Energy(), 0, 1e-6);
}

INSTANTIATE_TEST_SUITE_P(Pools, MatchingTest, testing::Values(100, 0));

}  // namespace
}  // namespace isomatch
