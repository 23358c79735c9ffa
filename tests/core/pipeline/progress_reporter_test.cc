#include "core/pipeline/progress_reporter.h"

#include <vector>

#include <gtest/gtest.h>

namespace isomatch {
namespace {

TEST(ProgressReporterTest, StagesBeginWithZeroEndWithOneAndTotalsRise) {
  std::vector<Progress> seen;
  ProgressReporter reporter([&](const Progress& p) { seen.push_back(p); },
                            {{Stage::kGeodesics, 1}, {Stage::kDense, 3}});
  reporter.Begin(Stage::kGeodesics);
  reporter.Share(0, 2)(0.5);
  reporter.Share(1, 2)(1);
  reporter.Share(0, 2)(0.2);  // a late report changes nothing
  reporter.Begin(Stage::kDense);
  reporter.Finish();
  const std::vector<double> stage_fractions = {0, 0.25, 0.75, 1, 0, 1};
  const std::vector<double> totals = {0, 0.0625, 0.1875, 0.25, 0.25, 1};
  ASSERT_EQ(seen.size(), stage_fractions.size());
  for (std::size_t i = 0; i < seen.size(); ++i) {
    EXPECT_EQ(seen[i].stage, i < 4 ? Stage::kGeodesics : Stage::kDense);
    EXPECT_DOUBLE_EQ(seen[i].stage_fraction, stage_fractions[i]);
    EXPECT_DOUBLE_EQ(seen[i].total_fraction, totals[i]);
  }
}

TEST(ProgressReporterTest, NobodyNeedsToListen) {
  ProgressReporter reporter({}, {{Stage::kDense, 1}});
  reporter.Begin(Stage::kDense);
  reporter.Share(0, 1)(0.5);
  reporter.Finish();
}

}  // namespace
}  // namespace isomatch
