#include "client/viewer/view_details.h"

#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/matchers.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

PairView BareView() {
  PairView view;
  view.x = {"a.off", BumpySphere(2)};
  view.y = {"b.off", BumpySphere(2)};
  view.y_from_x.resize(view.x.mesh.num_vertices());
  std::iota(view.y_from_x.begin(), view.y_from_x.end(), 0);
  view.warnings = {"X: of reading the file"};
  return view;
}

std::vector<std::string> Titles(const PairView& view) {
  std::vector<std::string> titles;
  for (const FigureTable& table : view.figures) titles.push_back(table.title);
  return titles;
}

std::vector<std::string> LayerIds(const PairView& view) {
  std::vector<std::string> ids;
  for (const ScalarLayer& layer : view.layers) ids.push_back(layer.id);
  return ids;
}

TEST(AddDetailsTest, WithoutAnyThePageTellsOfTheMap) {
  PairView view = BareView();
  ASSERT_THAT(AddDetails({}, view), IsOk());
  EXPECT_EQ(view.title, "a.off \u2192 b.off");
  EXPECT_EQ(view.colors_y.size(), view.y_from_x.size());
  EXPECT_THAT(Titles(view), ElementsAre("Map"));
  EXPECT_THAT(LayerIds(view), ElementsAre("distortion"));
  EXPECT_THAT(view.warnings, ElementsAre("X: of reading the file"));
}

TEST(AddDetailsTest, ShowsWhatIsGiven) {
  PairView view = BareView();
  const std::vector<float> confidence(view.y_from_x.size(), 0.25F);
  ASSERT_THAT(AddDetails({.title = "Two spheres",
                          .report = R"({"symmetry_confidence": 0.5,
                                        "total_seconds": 1,
                                        "warnings": ["X: once"]})",
                          .report_path = "r.json",
                          .confidence = confidence},
                         view),
              IsOk());
  EXPECT_EQ(view.title, "Two spheres");
  EXPECT_THAT(Titles(view), ElementsAre("Map", "Quality", "Run"));
  EXPECT_THAT(LayerIds(view), ElementsAre("distortion", "confidence"));
  EXPECT_EQ(view.layers.back().on_x, confidence);
  EXPECT_THAT(view.warnings, ElementsAre("X: once"));
}

TEST(AddDetailsTest, AReportOfOtherMeshesIsNamed) {
  PairView view = BareView();
  EXPECT_THAT(AddDetails({.report = R"({"mesh_y": {"vertices": 7}})",
                          .report_path = "r.json"},
                         view),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("'r.json': mesh_y.vertices is 7")));
}

}  // namespace
}  // namespace isomatch
