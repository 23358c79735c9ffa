#include "client/viewer/picture.h"

#include <png.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/strings/string_view.h"
#include "core/mesh/mesh_geometry.h"
#include "tests/support/matchers.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

constexpr Rgb kWhite = {255, 255, 255};

PairView IdentityView(const TriangleMesh& mesh) {
  PairView view;
  view.x = {"x.off", mesh};
  view.y = {"y.off", mesh};
  view.y_from_x.resize(mesh.num_vertices());
  std::iota(view.y_from_x.begin(), view.y_from_x.end(), 0);
  view.colors_y = PositionRgb(mesh.positions, BoxOfFaces(mesh));
  return view;
}

Image Draw(const PairView& view, const std::string& layer = "colors") {
  return DrawPair(view, {.width = 240, .height = 120, .layer = layer});
}

/// Pixels of one half that are not background.
int Covered(const Image& image, int half) {
  int covered = 0;
  for (int row = 0; row < image.height; ++row) {
    for (int column = 0; column < image.width / 2; ++column) {
      covered += image.At(column + half * image.width / 2, row) != kWhite;
    }
  }
  return covered;
}

Image Decoded(absl::string_view png) {
  png_image header = {};
  header.version = PNG_IMAGE_VERSION;
  EXPECT_TRUE(
      png_image_begin_read_from_memory(&header, png.data(), png.size()));
  header.format = PNG_FORMAT_RGB;
  Image image(static_cast<int>(header.width), static_cast<int>(header.height),
              kWhite);
  EXPECT_TRUE(
      png_image_finish_read(&header, nullptr, image.pixels.data(), 0, nullptr));
  return image;
}

TEST(PictureTest, PngGivesTheImageBack) {
  const Image image = Draw(IdentityView(BumpySphere(3)));
  const absl::StatusOr<std::string> png = EncodePng(image);
  ASSERT_THAT(png, IsOk());
  const Image decoded = Decoded(*png);
  EXPECT_EQ(decoded.width, 240);
  EXPECT_EQ(decoded.height, 120);
  EXPECT_EQ(decoded.pixels, image.pixels);
  EXPECT_EQ(*EncodePng(image), *png);
}

TEST(PictureTest, AllPixelsAreOfTheRightSizeEvenWhenOdd) {
  const Image image =
      DrawPair(IdentityView(BumpySphere(2)), {.width = 131, .height = 77});
  EXPECT_EQ(image.pixels.size(), 131 * 77);
  EXPECT_EQ(image.At(65, 38), kWhite);  // between the halves
}

// A disc of radius r covers pi r^2 pixels, r being 0.9 of half the height.
TEST(PictureTest, ASphereCoversADisc) {
  const Image image = Draw(IdentityView(UnitSphere(5)));
  const double expected = std::acos(-1) * std::pow(0.9 * 60, 2);
  for (const int half : {0, 1}) {
    EXPECT_NEAR(Covered(image, half), expected, 0.04 * expected) << half;
  }
}

TEST(PictureTest, BothHalvesLookTheSameUnderTheIdentityOfAnyScale) {
  PairView view = IdentityView(FiveArms(4));
  view.y.mesh.positions *= 1024;
  const Image image = Draw(view);
  for (int row = 0; row < image.height; ++row) {
    for (int column = 0; column < 120; ++column) {
      ASSERT_EQ(image.At(column, row), image.At(column + 120, row))
          << column << " " << row;
    }
  }
}

bool IsGray(const Rgb& pixel) {
  const auto [least, most] = std::minmax_element(pixel.begin(), pixel.end());
  return *most - *least < 4 && pixel != kWhite;
}

TEST(PictureTest, WhatHasNoCounterpartIsGrayAndPlainOnBothHalves) {
  PairView view = IdentityView(BumpySphere(4));
  const Image whole = Draw(view);
  view.matched_y.assign(view.y_from_x.size(), 1);
  for (std::size_t x = 0; x < view.y_from_x.size(); ++x) {
    if (view.x.mesh.positions(static_cast<Eigen::Index>(x), 1) < 0) {
      view.y_from_x[x] = kNoVertex;
      view.matched_y[x] = 0;
    }
  }
  const Image plain = Draw(view);
  const Image checked = DrawPair(
      view, {.width = 240, .height = 120, .pattern = Pattern::kChecker});
  for (const int half : {0, 1}) {
    int grays = 0;
    int grays_of_whole = 0;
    int changed = 0;
    for (int row = 0; row < plain.height; ++row) {
      for (int column = 120 * half; column < 120 * half + 120; ++column) {
        grays_of_whole += IsGray(whole.At(column, row));
        if (!IsGray(plain.At(column, row))) continue;
        ++grays;
        changed += checked.At(column, row) != plain.At(column, row);
      }
    }
    const int covered = Covered(plain, half);
    EXPECT_GT(grays, covered / 5) << half;
    EXPECT_LT(grays, covered / 2) << half;
    EXPECT_LT(grays_of_whole, covered / 20) << half;
    EXPECT_LT(changed, grays / 50) << half;
  }
}

TEST(PictureTest, AMirroredMapShows) {
  const TriangleMesh body = MirrorSymmetricBody(4);
  PairView view = IdentityView(body);
  const Image good = Draw(view);
  for (VertexIndex x = 0; x < body.num_vertices(); ++x) {
    const Eigen::RowVector3d mirrored =
        body.positions.row(x).cwiseProduct(Eigen::RowVector3d(1, 1, -1));
    (body.positions.rowwise() - mirrored)
        .rowwise()
        .squaredNorm()
        .minCoeff(&view.y_from_x[x]);
  }
  const Image bad = Draw(view);
  int changed = 0;
  for (std::size_t i = 0; i < good.pixels.size(); ++i) {
    for (int channel = 0; channel < 3; ++channel) {
      if (std::abs(good.pixels[i][channel] - bad.pixels[i][channel]) > 25) {
        ++changed;
        break;
      }
    }
  }
  EXPECT_GT(changed, Covered(good, 0) / 2);
  EXPECT_EQ(Covered(good, 0), Covered(bad, 0));
}

TEST(PictureTest, WithoutAnImageAllIsGray) {
  PairView view = IdentityView(BumpySphere(3));
  std::fill(view.y_from_x.begin(), view.y_from_x.end(), kNoVertex);
  const Image image = Draw(view);
  for (int row = 0; row < image.height; ++row) {
    for (int column = 0; column < 120; ++column) {
      const Rgb& pixel = image.At(column, row);
      EXPECT_EQ(pixel[0], pixel[1]);
      EXPECT_EQ(pixel[1], pixel[2]);
    }
  }
}

TEST(PictureTest, NearFacesHideFarOnes) {
  // Two squares, the red one nearer to the viewer, the green one drawn later.
  TriangleMesh mesh = PlaneGrid(1, 1, 1, 1);
  const TriangleMesh far = mesh;
  mesh.positions.conservativeResize(8, 3);
  mesh.positions.bottomRows(4) = far.positions;
  mesh.positions.topRows(4).col(2).array() += 0.1;
  mesh.faces.conservativeResize(4, 3);
  mesh.faces.bottomRows(2) = far.faces.array() + 4;
  Image image(20, 20, kWhite);
  Positions points = mesh.positions * 18;
  points.leftCols(2).array() += 1;
  const Positions up =
      Positions::Constant(8, 3, 0).rowwise() + Eigen::RowVector3d(0, 0, 1);
  std::vector<Rgb> colors(8, Rgb{255, 0, 0});
  std::fill(colors.begin() + 4, colors.end(), Rgb{0, 255, 0});
  DrawSurface({points, mesh.faces, up, colors, mesh.positions}, Pattern::kPlain,
              image);
  EXPECT_GT(image.At(10, 10)[0], 200);
  EXPECT_LT(image.At(10, 10)[1], 60);
  EXPECT_EQ(image.At(0, 0), kWhite);
}

TEST(PictureTest, WhatLiesOutsideIsLeftOut) {
  const TriangleMesh mesh = PlaneGrid(1, 1, 1, 1);
  Image image(10, 10, kWhite);
  Positions points = mesh.positions * 100;
  points.leftCols(2).array() -= 50;
  const Positions up =
      Positions::Zero(4, 3).rowwise() + Eigen::RowVector3d(0, 0, 1);
  const std::vector<Rgb> colors(4, Rgb{9, 9, 9});
  DrawSurface({points, mesh.faces, up, colors, mesh.positions}, Pattern::kPlain,
              image);
  EXPECT_EQ(std::count(image.pixels.begin(), image.pixels.end(), kWhite), 0);
  points.col(0).array() += 500;
  Image empty(10, 10, kWhite);
  DrawSurface({points, mesh.faces, up, colors, mesh.positions}, Pattern::kPlain,
              empty);
  EXPECT_EQ(std::count(empty.pixels.begin(), empty.pixels.end(), kWhite), 100);
}

TEST(PictureTest, ALayerIsDrawnWithItsScale) {
  PairView view = IdentityView(UnitSphere(3));
  ScalarLayer layer = {.id = "error", .palette = ErrorPalette()};
  layer.on_x.assign(view.y_from_x.size(), 1);
  layer.on_y.assign(view.y_from_x.size(), 0);
  view.layers = {layer};
  const Image image = Draw(view, "error");
  EXPECT_LT(image.At(60, 60)[1], 60);    // dark red on X
  EXPECT_GT(image.At(180, 60)[1], 200);  // pale yellow on Y
  EXPECT_EQ(image.At(84, 115), layer.palette.front());
  EXPECT_GT(image.At(85, 115)[0], image.At(155, 115)[0]);
}

TEST(PictureTest, PatternsDarkenHalfOfTheSurface) {
  const PairView view = IdentityView(UnitSphere(5));
  const Image plain = Draw(view);
  for (const Pattern pattern : {Pattern::kStripes, Pattern::kChecker}) {
    const Image image =
        DrawPair(view, {.width = 240, .height = 120, .pattern = pattern});
    int darker = 0;
    for (std::size_t i = 0; i < image.pixels.size(); ++i) {
      darker += image.pixels[i][1] < 0.8 * plain.pixels[i][1];
    }
    const int covered = Covered(plain, 0) + Covered(plain, 1);
    EXPECT_GT(darker, 0.3 * covered);
    EXPECT_LT(darker, 0.7 * covered);
  }
}

}  // namespace
}  // namespace isomatch
