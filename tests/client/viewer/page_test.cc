#include "client/viewer/page.h"

#include <cmath>
#include <cstring>
#include <limits>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "absl/strings/escaping.h"
#include "client/viewer/folder_page.h"
#include "core/io/draco_mesh.h"
#include "core/mesh/mesh_geometry.h"
#include "tests/support/matchers.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

using nlohmann::json;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

constexpr float kNone = std::numeric_limits<float>::quiet_NaN();

/// A sphere and a finer one, each vertex of X without a partner, or with one of
/// any number.
PairView SmallView() {
  PairView view;
  view.title = "a <b> & c";
  view.x = {"</script>", BumpySphere(1)};
  view.y = {"y.off", Moved(BumpySphere(2), 1000)};
  for (VertexIndex x = 0; x < view.x.mesh.num_vertices(); ++x) {
    view.y_from_x.push_back(3 * x);
  }
  view.y_from_x[5] = kNoVertex;
  view.colors_y = PositionRgb(view.y.mesh.positions, BoxOfFaces(view.y.mesh));
  ScalarLayer layer = {.id = "confidence", .palette = ConfidencePalette()};
  layer.on_x.assign(view.x.mesh.num_vertices(), 0.25F);
  layer.on_x[1] = 0.75F;
  layer.on_x[5] = kNone;
  layer.on_y.assign(view.y.mesh.num_vertices(), 0.5F);
  view.layers = {layer};
  view.figures = {{"Run", {{"total time", "1 s"}}}};
  view.warnings = {"mind"};
  return view;
}

json Data(const PairView& view) {
  return json::parse(FormatPageData(view, {"confidence", "checker"}).value());
}

template <typename T>
std::vector<T> Unpacked(const json& base64) {
  std::string bytes;
  EXPECT_TRUE(absl::Base64Unescape(base64.get<std::string>(), &bytes));
  EXPECT_EQ(bytes.size() % sizeof(T), 0);
  std::vector<T> values(bytes.size() / sizeof(T));
  std::memcpy(values.data(), bytes.data(), bytes.size());
  return values;
}

TEST(PageDataTest, HoldsWhatOfYHasACounterpartWhenThatIsKnown) {
  PairView view = SmallView();
  EXPECT_TRUE(Data(view)["matched_y"].is_null());
  view.matched_y.assign(view.y.mesh.num_vertices(), 1);
  view.matched_y[3] = 0;
  EXPECT_EQ(Unpacked<std::uint8_t>(Data(view)["matched_y"]), view.matched_y);
}

TEST(PageDataTest, HoldsTheMeshes) {
  const PairView view = SmallView();
  const json data = Data(view);
  for (const auto& [field, named] :
       {std::pair("x", &view.x), std::pair("y", &view.y)}) {
    const json& mesh = data[field];
    EXPECT_EQ(mesh["name"], named->name);
    EXPECT_EQ(mesh["vertices"], named->mesh.num_vertices());
    EXPECT_EQ(mesh["faces"], named->mesh.num_faces());
    EXPECT_EQ(mesh["order"], "id");
    const std::vector<char> bytes = Unpacked<char>(mesh["draco"]);
    const absl::StatusOr<TriangleMesh> decoded =
        DecodeDraco({bytes.data(), bytes.size()}, VertexOrder::kIdAttribute,
                    named->mesh.num_vertices());
    ASSERT_THAT(decoded, IsOk());
    EXPECT_EQ(decoded->num_faces(), named->mesh.num_faces());
    const Positions expected = NormalizedPositions(named->mesh);
    const double side =
        (expected.colwise().maxCoeff() - expected.colwise().minCoeff())
            .maxCoeff();
    // Half a step of 16 bits, and single precision.
    EXPECT_LT((decoded->positions - expected).cwiseAbs().maxCoeff(),
              0.51 * side / 65535 + 1e-6);
  }
}

TEST(PageDataTest, KeepsTheOrderOfVerticesOnNoFace) {
  PairView view = SmallView();
  TriangleMesh& mesh = view.x.mesh;
  mesh.positions.conservativeResize(mesh.num_vertices() + 1, 3);
  mesh.positions.bottomRows(1).setZero();
  view.y_from_x.push_back(kNoVertex);
  view.layers.clear();
  EXPECT_EQ(Data(view)["x"]["order"], "decoded");
}

TEST(PageDataTest, HoldsTheMapAndTheColors) {
  const PairView view = SmallView();
  const json data = Data(view);
  EXPECT_EQ(Unpacked<VertexIndex>(data["map"]), view.y_from_x);
  const std::vector<std::uint8_t> colors =
      Unpacked<std::uint8_t>(data["colors"]);
  ASSERT_EQ(colors.size(), 3 * view.colors_y.size());
  for (std::size_t y = 0; y < view.colors_y.size(); ++y) {
    for (int channel = 0; channel < 3; ++channel) {
      EXPECT_EQ(colors[3 * y + channel], view.colors_y[y][channel]);
    }
  }
  EXPECT_EQ(data["layer"], "confidence");
  EXPECT_EQ(data["pattern"], "checker");
  EXPECT_EQ(data["rotation"].size(), 9);
  EXPECT_EQ(data["figures"][0]["rows"][0][1], "1 s");
  EXPECT_THAT(data["warnings"].get<std::vector<std::string>>(),
              ElementsAre("mind"));
}

TEST(PageDataTest, HoldsTheLayersQuantized) {
  const PairView view = SmallView();
  const json layer = Data(view)["layers"][0];
  EXPECT_EQ(layer["id"], "confidence");
  EXPECT_THAT(layer["range"].get<std::vector<double>>(),
              ElementsAre(0.25, 0.75));
  EXPECT_EQ(Unpacked<std::uint8_t>(layer["palette"]).size(), 3 * 256);
  const std::vector<std::uint16_t> on_x = Unpacked<std::uint16_t>(layer["x"]);
  ASSERT_EQ(on_x.size(), view.y_from_x.size());
  EXPECT_EQ(on_x[0], 0);
  EXPECT_EQ(on_x[1], 65534);
  EXPECT_EQ(on_x[5], 65535);
  EXPECT_THAT(Unpacked<std::uint16_t>(layer["y"]), testing::Each(32767));
}

TEST(PageDataTest, ALayerMayBeEmptyOrConstant) {
  PairView view = SmallView();
  view.layers[0].on_x.assign(view.y_from_x.size(), kNone);
  view.layers[0].on_y.assign(view.colors_y.size(), kNone);
  EXPECT_THAT(Unpacked<std::uint16_t>(Data(view)["layers"][0]["x"]),
              testing::Each(65535));
  view.layers[0].on_x.assign(view.y_from_x.size(), 0.5F);
  EXPECT_THAT(Unpacked<std::uint16_t>(Data(view)["layers"][0]["x"]),
              testing::Each(0));
}

TEST(PageDataTest, TheVerdictStandsAloneAndFiguresAreExplained) {
  PairView view = SmallView();
  EXPECT_TRUE(Data(view)["verdict"].is_null());
  view.figures.push_back({"Quality",
                          {{"verdict", "doubtful"},
                           {"because", "why"},
                           {"what to do", "look"},
                           {"embedding error", "0.1"}}});
  view.figures.push_back({"Only", {{"because", "a row of the verdict"}}});
  const json data = Data(view);
  EXPECT_EQ(data["verdict"]["level"], "doubtful");
  EXPECT_EQ(data["verdict"]["advice"], "look");
  ASSERT_EQ(data["figures"].size(), 2);  // no table without a row
  EXPECT_EQ(data["figures"][1]["rows"].size(), 1);
  EXPECT_TRUE(data["explanations"].contains("embedding error"));
  EXPECT_TRUE(data["explanations"].contains("verdict"));
  EXPECT_FALSE(data["explanations"].contains("because"));
}

TEST(FolderPageTest, HoldsItsEntriesAndThePageOfPairs) {
  FolderEntry entry = {.name = "a__b",
                       .x = "</script>",
                       .verdict = "good",
                       .figures = {{"coverage", 0.5}},
                       .data = "{\"n\":1}"};
  const std::string page = FormatFolderPage("a <b>", {entry, {.name = "c"}});
  EXPECT_THAT(page, HasSubstr("<title>a &lt;b&gt;</title>"));
  EXPECT_THAT(page, HasSubstr("id=\"data-0\">{\"n\":1}</script>"));
  EXPECT_THAT(page, Not(HasSubstr("data-1")));
  EXPECT_THAT(page, HasSubstr("\"x\":\"\\u003c/script>\""));
  EXPECT_THAT(page, HasSubstr("\"coverage\":0.5"));
  EXPECT_THAT(page, HasSubstr("DracoDecoderModule"));
  const std::string before_script = page.substr(0, page.find("<script>"));
  EXPECT_EQ(before_script.find("<!--"), std::string::npos);
  // Without data there is nothing to make pages of.
  entry.data.clear();
  EXPECT_LT(FormatFolderPage("t", {entry}).size(), 100'000);
}

TEST(PageTest, IsWholeAndLoadsNothing) {
  const std::string page = FormatPage(SmallView(), {}).value();
  EXPECT_THAT(page, HasSubstr("<title>a &lt;b&gt; &amp; c</title>"));
  for (const char* author :
       {"three.js authors", "Garrett Johnson", "Draco Authors"}) {
    EXPECT_THAT(page, HasSubstr(author));  // as their licenses want
  }
  EXPECT_THAT(page, Not(HasSubstr("</script>\",\"vertices")));
  for (const char* mark : {"<!--", "/*STYLE*/", "/*DRACO*/", "/*SCRIPT*/"}) {
    EXPECT_THAT(page.substr(0, page.find("<script>")), Not(HasSubstr(mark)));
  }
  EXPECT_THAT(page, HasSubstr("DracoDecoderModule"));
  EXPECT_THAT(page, Not(HasSubstr(" src=")));
  EXPECT_THAT(page, HasSubstr("default-src 'none'"));
}

TEST(PageTest, IsTheSameEachTime) {
  EXPECT_EQ(FormatPage(SmallView(), {}).value(),
            FormatPage(SmallView(), {}).value());
}

}  // namespace
}  // namespace isomatch
