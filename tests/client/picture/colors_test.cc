#include "client/picture/colors.h"

#include <algorithm>
#include <cstdlib>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/mesh/mesh_geometry.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

/// Largest difference of a channel.
int Difference(const Rgb& a, const Rgb& b) {
  int difference = 0;
  for (int channel = 0; channel < 3; ++channel) {
    difference = std::max(difference, std::abs(a[channel] - b[channel]));
  }
  return difference;
}

/// Corners of a box of sides 4, 2, 1, in binary order of x, y, z.
Positions BoxCorners() {
  Positions corners(8, 3);
  for (int i = 0; i < 8; ++i) {
    corners.row(i) << 4 * (i & 1), 2 * ((i >> 1) & 1), (i >> 2) & 1;
  }
  return corners;
}

Eigen::AlignedBox3d BoxOf(const Positions& positions) {
  return {positions.colwise().minCoeff().transpose(),
          positions.colwise().maxCoeff().transpose()};
}

TEST(PositionRgbTest, AllCornersDiffer) {
  const std::vector<Rgb> colors =
      PositionRgb(BoxCorners(), BoxOf(BoxCorners()));
  for (int i = 0; i < 8; ++i) {
    EXPECT_GT(Difference(colors[i], kGray), 40) << i;
    for (int j = 0; j < i; ++j) {
      EXPECT_GT(Difference(colors[i], colors[j]), 24) << i << " " << j;
    }
  }
}

// Left and right legs lie close to the plane between them.
TEST(PositionRgbTest, SidesNearTheMiddleDiffer) {
  Positions positions(12, 3);
  positions.topRows(8) = BoxCorners();
  positions.row(8) << 2, 0.2, 0.35;
  positions.row(9) << 2, 0.2, 0.65;
  positions.row(10) << 2, 0.7, 0.5;
  positions.row(11) << 2, 1.3, 0.5;
  const std::vector<Rgb> colors = PositionRgb(positions, BoxOf(positions));
  EXPECT_GT(Difference(colors[8], colors[9]), 40);
  EXPECT_GT(Difference(colors[10], colors[11]), 40);
}

// A hundredth of the box changes no channel by more than 26 of 255
// levels; dark ones change fastest.
TEST(PositionRgbTest, NeighborsLookAlike) {
  constexpr double kRounding = 2;
  constexpr double kLevelsPerBox = 2600;
  const TriangleMesh mesh = FiveArms(5);
  const std::vector<Rgb> colors = PositionRgb(mesh.positions, BoxOfFaces(mesh));
  const Eigen::Array3d box =
      mesh.positions.colwise().maxCoeff() - mesh.positions.colwise().minCoeff();
  for (VertexIndex f = 0; f < mesh.num_faces(); ++f) {
    const VertexIndex a = mesh.faces(f, 0);
    const VertexIndex b = mesh.faces(f, 1);
    const Eigen::Array3d step = mesh.positions.row(a) - mesh.positions.row(b);
    EXPECT_LT(Difference(colors[a], colors[b]),
              kRounding + kLevelsPerBox * (step / box).abs().sum());
  }
}

TEST(PositionRgbTest, ScaleAndOriginDoNotMatter) {
  const Positions positions = BumpySphere(3).positions;
  // Powers of two keep every bit.
  Positions moved = positions * 1024;
  EXPECT_EQ(PositionRgb(positions, BoxOf(positions)),
            PositionRgb(moved, BoxOf(moved)));
  moved.setConstant(3);
  EXPECT_EQ(PositionRgb(moved, BoxOf(moved)).size(),
            moved.rows());  // no box at all
}

TEST(PaletteTest, EndsAndMiddleAreWhatTheyMean) {
  EXPECT_EQ(ConfidencePalette().front(), (Rgb{0x44, 0x01, 0x54}));
  EXPECT_EQ(ConfidencePalette().back(), (Rgb{0xfd, 0xe7, 0x25}));
  EXPECT_EQ(ErrorPalette().front(), (Rgb{0xff, 0xf4, 0xcd}));
  const Palette distortion = DistortionPalette();
  EXPECT_GT(distortion.front()[2], distortion.front()[0]);  // blue
  EXPECT_GT(distortion.back()[0], distortion.back()[2]);    // red
  for (const int channel : distortion[128]) EXPECT_GT(channel, 230);
}

}  // namespace
}  // namespace isomatch
