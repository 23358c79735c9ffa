#include "client/viewer/pair_view.h"

#include <cmath>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/LU>

#include "core/mesh/mesh_geometry.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

using testing::ElementsAre;
using testing::IsNan;

constexpr float kNoValue = std::numeric_limits<float>::quiet_NaN();

TEST(PairViewTest, NormalizedShapesHaveAreaOneAroundTheOrigin) {
  const TriangleMesh mesh = Moved(FiveArms(3), 1e6);
  const TriangleMesh normalized = {NormalizedPositions(mesh), mesh.faces};
  EXPECT_NEAR(SurfaceArea(normalized), 1, 1e-9);
  EXPECT_NEAR(normalized.positions.colwise().maxCoeff()[0] +
                  normalized.positions.colwise().minCoeff()[0],
              0, 1e-9);
}

/// An ellipsoid of these half axes.
TriangleMesh Ellipsoid(double x, double y, double z) {
  TriangleMesh mesh = UnitSphere(2);
  mesh.positions.col(0) *= x;
  mesh.positions.col(1) *= y;
  mesh.positions.col(2) *= z;
  return mesh;
}

/// Rows of the rotation for ellipsoids of these half axes.
Eigen::Matrix3d Rotation(double x, double y, double z,
                         std::optional<int> up = std::nullopt) {
  const TriangleMesh mesh = Ellipsoid(x, y, z);
  return ViewRotation(mesh, mesh, up);
}

TEST(ViewRotationTest, ThinAxisLeadsToTheViewerAndIsNeverUp) {
  const auto x = Eigen::RowVector3d::UnitX();
  const auto y = Eigen::RowVector3d::UnitY();
  const auto z = Eigen::RowVector3d::UnitZ();
  const Eigen::Matrix3d person = Rotation(3, 4, 1);  // y up, seen from z
  EXPECT_EQ(person, Eigen::Matrix3d::Identity());
  const Eigen::Matrix3d animal = Rotation(4, 1, 2);  // z up, seen from -y
  EXPECT_EQ(animal.row(0), x);
  EXPECT_EQ(animal.row(1), z);
  EXPECT_EQ(animal.row(2), -y);
  const Eigen::Matrix3d sideways = Rotation(1, 3, 4);  // y up, seen from x
  EXPECT_EQ(sideways.row(1), y);
  EXPECT_EQ(sideways.row(2), x);
}

TEST(ViewRotationTest, TheUserDecidesWhatIsUp) {
  for (int up = 0; up < 3; ++up) {
    const Eigen::Matrix3d rotation = Rotation(3, 1, 2, up);
    EXPECT_EQ(rotation(1, up), 1);
    EXPECT_NEAR(rotation.determinant(), 1, 1e-12);
  }
}

TEST(NormalizedPositionsTest, AVertexOnNoFaceLeavesTheShapeItsRoom) {
  const TriangleMesh mesh = PlaneGrid(4, 3, 4, 3);
  TriangleMesh stray = mesh;
  stray.positions.conservativeResize(mesh.num_vertices() + 1, 3);
  stray.positions.bottomRows(1) << 1000, -1000, 1;
  const Positions expected = NormalizedPositions(mesh);
  const Positions found = NormalizedPositions(stray);
  EXPECT_EQ(found.topRows(mesh.num_vertices()), expected);
  const Eigen::RowVector3d last = found.row(mesh.num_vertices());
  EXPECT_EQ(last[0], expected.col(0).maxCoeff());
  EXPECT_EQ(last[1], expected.col(1).minCoeff());
  EXPECT_EQ(ViewRotation(stray, stray, std::nullopt),
            ViewRotation(mesh, mesh, std::nullopt));
}

TEST(CarryToYTest, TakesMeansAndFillsFromTheNearest) {
  // A strip of 5 x 2 vertices, 0 to 4 in the first row.
  const TriangleMesh y = PlaneGrid(4, 1, 4, 1);
  const std::vector<float> on_x = {1, 3, 8, kNoValue, 5};
  const VertexMap y_from_x = {0, 0, 4, 4, kNoVertex};
  const std::vector<float> on_y = CarryToY(on_x, y_from_x, y);
  EXPECT_EQ(on_y[0], 2);
  EXPECT_EQ(on_y[1], 2);
  EXPECT_EQ(on_y[3], 8);
  EXPECT_EQ(on_y[4], 8);
}

TEST(CarryToYTest, NothingIsCarriedToWhatHasNoCounterpart) {
  const TriangleMesh y = PlaneGrid(4, 1, 4, 1);
  std::vector<std::uint8_t> matched(10, 1);
  matched[1] = matched[4] = 0;
  const std::vector<float> on_y = CarryToY({1, 3}, {0, 4}, y, matched);
  EXPECT_THAT(on_y[1], IsNan());
  EXPECT_THAT(on_y[4], IsNan());
  EXPECT_EQ(on_y[0], 1);
  EXPECT_EQ(on_y[3], 3);
}

TEST(CarryToYTest, NothingIsCarriedWhereNothingLeads) {
  const TriangleMesh y = PlaneGrid(4, 1, 4, 1);
  EXPECT_THAT(CarryToY({5}, {kNoVertex}, y), testing::Each(IsNan()));
}

TEST(PairViewTest, VerticesOfXHaveTheColorsOfTheirImages) {
  PairView view;
  view.colors_y = {{1, 2, 3}, {4, 5, 6}};
  view.y_from_x = {1, kNoVertex, 0, 1};
  EXPECT_THAT(ColorsOfX(view),
              ElementsAre(Rgb{4, 5, 6}, kGray, Rgb{1, 2, 3}, Rgb{4, 5, 6}));
}

TEST(PairViewTest, WhatHasNoCounterpartIsGrayAndTold) {
  PairView view;
  view.x.mesh = view.y.mesh = PlaneGrid(1, 1, 1, 1);
  // One more, on no face.
  view.x.mesh.positions.conservativeResize(5, 3);
  view.colors_y.assign(4, Rgb{1, 2, 3});
  view.y_from_x = {0, 1, 2, 3, kNoVertex};
  EXPECT_EQ(ColorsOfY(view), view.colors_y);
  EXPECT_EQ(GrayText(view), "");
  view.y_from_x[1] = kNoVertex;
  view.matched_y = {0, 1, 1, 0};
  EXPECT_THAT(ColorsOfY(view),
              ElementsAre(kGray, Rgb{1, 2, 3}, Rgb{1, 2, 3}, kGray));
  EXPECT_EQ(GrayText(view), "no counterpart: 1 vertices of X, 2 of Y");
  view.colors_x = view.colors_y;  // the files' own
  EXPECT_EQ(ColorsOfY(view), view.colors_y);
}

TEST(PairViewTest, ColorsAreMixedWhereImagesLieBetweenVertices) {
  PairView view;
  view.colors_y = {{0, 0, 0}, {100, 200, 40}, {100, 0, 40}};
  view.y.mesh.faces.resize(1, 3);
  view.y.mesh.faces << 0, 1, 2;
  view.precise = {{0, {0.5, 0.25, 0.25}}, SurfacePoint{}};
  view.y_from_x = {0, kNoVertex};
  EXPECT_THAT(ColorsOfX(view), ElementsAre(Rgb{50, 50, 20}, kGray));
}

TEST(PairViewTest, LayersAreColoredByTheirScale) {
  ScalarLayer layer = {.id = "error", .low = 2, .high = 4};
  for (int i = 0; i < 256; ++i) {
    layer.palette[i] = {static_cast<std::uint8_t>(i), 0, 0};
  }
  EXPECT_THAT(LayerColors(layer, {2, 3, 4, 9, -9, kNoValue}),
              ElementsAre(Rgb{0, 0, 0}, Rgb{128, 0, 0}, Rgb{255, 0, 0},
                          Rgb{255, 0, 0}, Rgb{0, 0, 0}, kGray));
}

TEST(PairViewTest, FindsLayersById) {
  PairView view;
  view.layers = {{.id = "error"}};
  EXPECT_EQ(FindLayer(view, "error"), &view.layers[0]);
  EXPECT_EQ(FindLayer(view, "colors"), nullptr);
}

}  // namespace
}  // namespace isomatch
