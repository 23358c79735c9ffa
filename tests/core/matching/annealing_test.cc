#include "core/matching/annealing.h"

#include <gtest/gtest.h>

#include "tests/support/hashed_test_shape.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

class AnnealingTest : public testing::Test {
 protected:
  AnnealingTest()
      : shape_(FiveArms(3), /*pool_size=*/200),
        matching_(shape_.pool(), shape_.pool(), 60) {
    for (int p = 0; p < 60; ++p) matching_.Add({p, p});
  }

  int Wrong() const {
    int wrong = 0;
    for (const PointMatch& match : matching_.Matches()) {
      wrong += match.x != match.y;
    }
    return wrong;
  }

  HashedTestShape shape_;
  Matching matching_;
  RandomStream random_{3, 0};
};

TEST_F(AnnealingTest, TheEnergyNeverRisesAtTemperatureZero) {
  for (int i = 0; i < 30; ++i) matching_.Swap(i, 59 - i);
  double energy = matching_.Energy();
  for (int phase = 0; phase < 200; ++phase) {
    SwapPhase({/*proposals=*/5, /*neighbors=*/0}, 0, &random_, &matching_);
    EXPECT_LE(matching_.Energy(), energy + 1e-4);
    energy = matching_.Energy();
  }
}

TEST_F(AnnealingTest, ExchangedMatchesFindBack) {
  matching_.Swap(10, 31);
  matching_.Swap(7, 55);
  ASSERT_EQ(Wrong(), 4);
  EXPECT_GE(SwapPhase({/*proposals=*/20000, /*neighbors=*/0}, 0, &random_,
                      &matching_),
            2);
  EXPECT_EQ(Wrong(), 0);
}

TEST_F(AnnealingTest, PartnersAreDrawnFromTheNeighbors) {
  // Match 0 and the match farthest from it are no neighbors among four.
  int far = 1;
  for (int i = 2; i < 60; ++i) {
    if (matching_.closeness(kX, 0, i) < matching_.closeness(kX, 0, far)) {
      far = i;
    }
  }
  matching_.Swap(0, far);
  SwapPhase({/*proposals=*/5000, /*neighbors=*/4}, 0, &random_, &matching_);
  EXPECT_FALSE(matching_.point(kY, 0) == 0 && matching_.point(kY, far) == far);
}

TEST_F(AnnealingTest, HotterPhasesAcceptMore) {
  int accepted[3];
  for (int i = 0; i < 3; ++i) {
    RandomStream random(9, 0);
    const double temperature = i == 0 ? 0 : i == 1 ? 3 : 300;
    accepted[i] = SwapPhase({/*proposals=*/3000, /*neighbors=*/0}, temperature,
                            &random, &matching_);
  }
  EXPECT_EQ(accepted[0], 0);
  EXPECT_GT(accepted[1], 0);
  EXPECT_GT(accepted[2], accepted[1]);
  // exp(-dE / T) is near one when T is far above every change.
  EXPECT_GT(accepted[2], 2400);
}

TEST_F(AnnealingTest, RelocationBringsADisplacedMatchHome) {
  const int near = [&] {
    int best = 60;
    for (int p = 60; p < 200; ++p) {
      if (matching_.Row(kY, 5)[p] > matching_.Row(kY, 5)[best]) best = p;
    }
    return best;
  }();
  matching_.Relocate(5, near);
  const double displaced = matching_.Energy();
  EXPECT_GE(RelocationSweep(/*neighbors=*/16, &matching_), 1);
  EXPECT_EQ(matching_.point(kY, 5), 5);
  EXPECT_LT(matching_.Energy(), displaced);
  EXPECT_EQ(RelocationSweep(/*neighbors=*/16, &matching_), 0);
}

TEST_F(AnnealingTest, OneMatchHasNothingToSwapWith) {
  Matching one(shape_.pool(), shape_.pool(), 1);
  one.Add({3, 3});
  EXPECT_EQ(SwapPhase({}, 1, &random_, &one), 0);
}

}  // namespace
}  // namespace isomatch
