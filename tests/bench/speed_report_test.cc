#include "tests/bench/speed_report.h"

#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/matchers.h"
#include "tests/support/temporary_folder.h"

namespace isomatch::bench {
namespace {

using testing::HasSubstr;
using testing::Not;

nlohmann::json Pair(const char* name, double seconds) {
  return {{"pair", name},
          {"vertices", 5000},
          {"wall_seconds", seconds},
          {"cpu_seconds", 2 * seconds},
          {"prepared_wall_seconds", seconds / 2},
          {"stages",
           {{"choice",
             {{"wall_seconds", seconds / 4}, {"cpu_seconds", seconds / 3}}}}}};
}

nlohmann::json Report(const nlohmann::json& pairs) {
  return {{"profile", "default"},
          {"threads", 1},
          {"instruction_set", "baseline"},
          {"kernels", nlohmann::json::array()},
          {"pairs", pairs}};
}

TEST(SpeedReportTest, TheMeanIsOfEveryFigure) {
  const nlohmann::json mean = MeanOfPairs({Pair("a b", 1), Pair("a c", 3)});
  EXPECT_DOUBLE_EQ(mean["wall_seconds"].get<double>(), 2);
  EXPECT_DOUBLE_EQ(mean["cpu_seconds"].get<double>(), 4);
  EXPECT_DOUBLE_EQ(mean["prepared_wall_seconds"].get<double>(), 1);
  EXPECT_DOUBLE_EQ(mean["stages"]["choice"]["wall_seconds"].get<double>(), 0.5);
}

TEST(SpeedReportTest, OnlyPairsOfBothRunsAreCompared) {
  const std::string text =
      ComparisonText(Report({Pair("a b", 1), Pair("new one", 9)}),
                     Report({Pair("a b", 2), Pair("old one", 7)}));
  EXPECT_THAT(text, HasSubstr("1.000   2.000  0.50"));
  EXPECT_THAT(text, HasSubstr("mean of 1"));
  EXPECT_THAT(text, HasSubstr("choice"));
  EXPECT_THAT(text, Not(HasSubstr(" one")));
  EXPECT_THAT(text, Not(HasSubstr("not alike")));
}

TEST(SpeedReportTest, WhatIsNotAlikeIsSaid) {
  nlohmann::json other = Report(nlohmann::json::array({Pair("x y", 1)}));
  other["threads"] = 2;
  const std::string text =
      ComparisonText(Report(nlohmann::json::array({Pair("a b", 1)})), other);
  EXPECT_THAT(text, HasSubstr("not alike: threads 1, before 2"));
  EXPECT_THAT(text, HasSubstr("none of these pairs"));
}

TEST(SpeedReportTest, OtherFilesAreRefused) {
  const TemporaryFolder folder;
  const std::string path = folder.Path("kept.json");
  EXPECT_THAT(ReadSpeedReport(path),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("kept.json")));
  for (const char* text : {"{}", "[1, 2]", "pairs", "{\"pairs\": []}"}) {
    std::ofstream(path) << text;
    EXPECT_THAT(ReadSpeedReport(path),
                StatusIs(absl::StatusCode::kInvalidArgument,
                         HasSubstr("kept.json: expected what")))
        << text;
  }
  std::ofstream(path) << Report(nlohmann::json::array({Pair("a b", 1)}));
  EXPECT_THAT(ReadSpeedReport(path), IsOk());
}

}  // namespace
}  // namespace isomatch::bench
