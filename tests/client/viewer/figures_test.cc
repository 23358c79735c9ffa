#include "client/viewer/figures.h"

#include <cmath>
#include <optional>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/matchers.h"

namespace isomatch {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Pair;

constexpr char kReport[] = R"({
  "mesh_x": {"vertices": 5, "faces": 6, "area": 1.5},
  "mesh_y": {"vertices": 4, "faces": 4, "area": 1.5},
  "profile": "default",
  "seconds": {"preparing": 0.25, "choice": 0.5},
  "total_seconds": 0.81,
  "peak_resident_bytes": 34000000,
  "symmetry_confidence": 0.75,
  "quality": {"coverage": 0.987},
  "alternatives": [{}, {}],
  "warnings": ["X: 1 face repeats another"]
})";

absl::StatusOr<ReportFigures> Parse(const std::string& text) {
  return ParseReport("r.json", text, 5, 4);
}

void ExpectError(const std::string& text, const std::string& why) {
  EXPECT_THAT(Parse(text),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("'r.json'"), HasSubstr(why))));
}

TEST(ParseReportTest, ShowsTimesMemoryAndQuality) {
  const absl::StatusOr<ReportFigures> figures = Parse(kReport);
  ASSERT_THAT(figures, IsOk());
  ASSERT_EQ(figures->tables.size(), 2);
  EXPECT_THAT(figures->tables[0].rows,
              ElementsAre(Pair("symmetry confidence (0 to 1)", "0.75"),
                          Pair("coverage of Y's area", "98.70 %"),
                          Pair("maps that were not chosen", "2")));
  EXPECT_THAT(
      figures->tables[1].rows,
      ElementsAre(Pair("profile", "default"), Pair("preparing", "0.25 s"),
                  Pair("choice", "0.50 s"), Pair("total time", "0.81 s"),
                  Pair("peak memory of the process", "34 MB")));
  EXPECT_THAT(figures->warnings, ElementsAre("X: 1 face repeats another"));
}

TEST(ParseReportTest, TheVerdictComesFirst) {
  const absl::StatusOr<ReportFigures> figures = Parse(
      R"({"verdict": {"level": "bad", "reason": "torn", "advice": "look"},
          "symmetry_confidence": 0.75})");
  ASSERT_THAT(figures, IsOk());
  EXPECT_THAT(figures->tables[0].rows,
              ElementsAre(Pair("verdict", "bad"), Pair("because", "torn"),
                          Pair("what to do", "look"),
                          Pair("symmetry confidence (0 to 1)", "0.75")));
  ExpectError(R"({"verdict": {"level": 2}})",
              "verdict.level is 2, expected a text");
}

TEST(ParseReportTest, FieldsMayBeMissing) {
  const absl::StatusOr<ReportFigures> figures = Parse("{}");
  ASSERT_THAT(figures, IsOk());
  EXPECT_THAT(figures->tables, IsEmpty());
}

TEST(ParseReportTest, ErrorsNameLineOrField) {
  ExpectError("{\n\"profile\": }", "line 2: not JSON");
  ExpectError("[1]", "found array, expected an object");
  ExpectError(R"({"profile": 3})", "profile is 3, expected a text");
  ExpectError(R"({"total_seconds": "x"})",
              "total_seconds is \"x\", expected a number");
  ExpectError(R"({"seconds": 1})", "seconds is 1, expected an object");
  ExpectError(R"({"seconds": {"choice": []}})", "seconds.choice is []");
  ExpectError(R"({"quality": {"coverage": null}})", "quality.coverage is null");
  ExpectError(R"({"alternatives": 1})", "alternatives is 1, expected an array");
  ExpectError(R"({"warnings": "x"})", "warnings is \"x\", expected an array");
  ExpectError(R"({"warnings": [1]})", "warnings is 1, expected texts");
}

TEST(ParseReportTest, TheReportMustBeOfThisPair) {
  ExpectError(R"({"mesh_x": {"vertices": 6}})",
              "mesh_x.vertices is 6, expected 5, as the mesh has");
  ExpectError(R"({"mesh_y": {"vertices": 5}})", "mesh_y.vertices is 5");
}

TEST(MapFiguresTest, CountsImages) {
  PairView view;
  view.y.mesh.positions = Positions::Zero(4, 3);
  view.y_from_x = {2, kNoVertex, 2, 0, 3};
  view.layers = {{.id = "distortion", .on_x = {-1, 0, 1, NAN, 0}}};
  EXPECT_THAT(MapFigures(view).rows,
              ElementsAre(Pair("vertices of X with an image", "4 of 5"),
                          Pair("vertices of Y that are images", "3 of 4"),
                          Pair(HasSubstr("distortion"), "0.5")));
  view.matched_y = {1, 0, 1, 1};
  EXPECT_THAT(MapFigures(view).rows,
              Contains(Pair("vertices of Y with a counterpart", "3 of 4")));
}

TEST(ErrorFiguresTest, ShowsWhatEvaluateShows) {
  GeodesicError error;
  error.evaluated = 7;
  error.mean_over_diameter = 0.0044;
  error.within[0] = 0.5;
  const FigureTable direct = ErrorFigures(error, std::nullopt);
  EXPECT_THAT(direct.rows[0], Pair("vertices compared", "7"));
  EXPECT_THAT(direct.rows[2], Pair("mean / diameter of Y", "0.00440"));
  EXPECT_THAT(direct.rows[4], Pair("within 0.01", "50.00 %"));
  EXPECT_THAT(ErrorFigures(error, error).rows.back(),
              Pair("mean against the mirrored truth", "0.00440"));
  EXPECT_THAT(ErrorFigures(error, std::nullopt, 0.25).rows.back(),
              Pair("IoU of the overlap, by area of X", "0.25000"));
}

}  // namespace
}  // namespace isomatch
