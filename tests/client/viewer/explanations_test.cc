#include "client/viewer/explanations.h"

#include <set>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "client/viewer/figures.h"

namespace isomatch {
namespace {

TEST(ExplanationsTest, EachFigureIsExplained) {
  const auto report = ParseReport("r.json", R"({
      "verdict": {"level": "good", "reason": "r", "advice": "a"},
      "symmetry_confidence": 1, "embedding_error": 0, "orientation_score": 1,
      "unmatched": 0, "alternatives": [], "profile": "default",
      "seconds": {"dense": 1}, "total_seconds": 2,
      "peak_resident_bytes": 5, "memory_estimate_bytes": 6,
      "quality": {"mean_confidence": 1, "geodesic_distortion": 0,
                  "area_distortion": 0, "coverage": 1}})",
                                  3, 3);
  ASSERT_TRUE(report.ok()) << report.status();
  std::vector<FigureTable> tables = report->tables;
  GeodesicError error;
  error.of_vertex = {0.0F};
  tables.push_back(ErrorFigures(error, error, 0.5));
  PairView view;
  view.matched_y = {1};
  view.layers = {{.id = "confidence"}, {.id = "distortion"}};
  tables.push_back(MapFigures(view));
  // Names of stages, and what stands beside the verdict.
  const std::set<std::string> plain = {"dense", "because", "what to do"};
  int count = 0;
  for (const FigureTable& table : tables) {
    for (const auto& [label, value] : table.rows) {
      EXPECT_EQ(Explanation(label).empty(), plain.count(label) > 0) << label;
      ++count;
    }
  }
  EXPECT_GT(count, 25);
}

TEST(ExplanationsTest, ALabelOfNoFigureHasNone) {
  EXPECT_EQ(Explanation("dense"), "");
  EXPECT_EQ(Explanation(""), "");
}

}  // namespace
}  // namespace isomatch
