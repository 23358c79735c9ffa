#include "tests/bench/run_pairs.h"

#include <vector>

#include <gtest/gtest.h>

namespace isomatch::bench {
namespace {

// A map that was turned around has its last stage alone, before others or
// behind them.
TEST(StageMeansTest, AreOverThePairsThatHadTheStage) {
  std::vector<PairResult> results(3);
  results[0].stages = {{Stage::kQuality, 0.5, 0.25}};
  results[1].stages = {{Stage::kDense, 0.25, 0.125},
                       {Stage::kAlignment, 0.0625, 0.0625},
                       {Stage::kQuality, 0.25, 0.25}};
  results[2].stages = {{Stage::kDense, 0.75, 0.125},
                       {Stage::kQuality, 0.75, 0.25}};
  const std::vector<StageError> means = StageMeans(results);
  ASSERT_EQ(means.size(), 3u);
  EXPECT_EQ(means[0].stage, Stage::kDense);
  EXPECT_EQ(means[0].direct, 0.5);
  EXPECT_EQ(means[0].best, 0.125);
  EXPECT_EQ(means[1].stage, Stage::kAlignment);
  EXPECT_EQ(means[1].direct, 0.0625);
  EXPECT_EQ(means[2].stage, Stage::kQuality);
  EXPECT_EQ(means[2].direct, 0.5);
  EXPECT_EQ(means[2].best, 0.25);
}

}  // namespace
}  // namespace isomatch::bench
