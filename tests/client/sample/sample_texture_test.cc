#include "client/sample/sample_texture.h"

#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/matchers.h"

namespace isomatch {
namespace {

TEST(SampleTextureTest, LeftIsWarmAndRightIsCold) {
  for (const SamplePattern pattern :
       {SamplePattern::kChecker, SamplePattern::kStripes}) {
    const Image picture = SamplePicture(pattern);
    std::set<Rgb> colors;
    for (int row = 0; row < picture.height; ++row) {
      for (int column = 0; column < picture.width; ++column) {
        const Rgb& color = picture.At(column, row);
        ASSERT_EQ(color[0] > color[2], column < picture.width / 2);
        colors.insert(color);
      }
    }
    EXPECT_EQ(colors.size(), 4u);
  }
}

TEST(SampleTextureTest, FacesLieInTheHalfOfTheirSide) {
  const absl::StatusOr<Sample> sample = MakeSample({'C', 1000, 3});
  ASSERT_THAT(sample, IsOk());
  const MeshTexture texture = SampleTexture(*sample, "c.mtl");
  for (VertexIndex f = 0; f < sample->mesh.num_faces(); ++f) {
    double side = 0;
    for (int i = 0; i < 3; ++i)
      side += sample->rest(sample->mesh.faces(f, i), 1);
    for (int i = 0; i < 3; ++i) {
      const double u = texture.coordinates(texture.corners(f, i), 0);
      ASSERT_EQ(u < 0.5, side >= 0);
    }
  }
  EXPECT_GE(texture.coordinates.minCoeff(), 0);
  EXPECT_LE(texture.coordinates.maxCoeff(), 1);
}

TEST(SampleTextureTest, VerticesHaveTheColorOfThePicture) {
  const absl::StatusOr<Sample> sample = MakeSample({'A', 500, 1});
  ASSERT_THAT(sample, IsOk());
  const Image picture = SamplePicture(SamplePattern::kChecker);
  const Colors colors = SampleColors(*sample, SamplePattern::kChecker);
  int same = 0;
  for (VertexIndex v = 0; v < sample->mesh.num_vertices(); ++v) {
    const Eigen::RowVector2d place =
        SampleCoordinates(sample->rest.row(v), sample->rest(v, 1) >= 0);
    const auto column = static_cast<int>(place.x() * picture.width);
    const auto row = static_cast<int>((1 - place.y()) * picture.height);
    same += ColorBytes(colors.row(v)) == picture.At(column, row);
  }
  // All but those within a pixel of a square's rim.
  EXPECT_GT(same, 480);
}

}  // namespace
}  // namespace isomatch
