#include "client/sample_texture.h"

#include <png.h>

#include <set>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/matchers.h"

namespace isomatch {
namespace {

/// What libpng reads from the bytes.
Picture Decoded(const std::string& bytes) {
  png_image image = {};
  image.version = PNG_IMAGE_VERSION;
  EXPECT_NE(
      png_image_begin_read_from_memory(&image, bytes.data(), bytes.size()), 0);
  image.format = PNG_FORMAT_RGB;
  Picture picture = {
      static_cast<int>(image.width), static_cast<int>(image.height), {}};
  picture.pixels.resize(PNG_IMAGE_SIZE(image));
  EXPECT_NE(
      png_image_finish_read(&image, nullptr, picture.pixels.data(), 0, nullptr),
      0);
  return picture;
}

TEST(PngFileTest, PixelsComeBack) {
  Picture picture = {3, 2, {}};
  for (int i = 0; i < 18; ++i) {
    picture.pixels.push_back(static_cast<std::uint8_t>(14 * i));
  }
  const absl::StatusOr<std::string> png = FormatPng(picture);
  ASSERT_THAT(png, IsOk());
  const Picture again = Decoded(*png);
  EXPECT_EQ(again.width, 3);
  EXPECT_EQ(again.height, 2);
  EXPECT_EQ(again.pixels, picture.pixels);
}

TEST(SampleTextureTest, LeftIsWarmAndRightIsCold) {
  for (const SamplePattern pattern :
       {SamplePattern::kChecker, SamplePattern::kStripes}) {
    const Picture picture = SamplePicture(pattern);
    ASSERT_EQ(picture.pixels.size(),
              3u * static_cast<unsigned>(picture.width * picture.height));
    std::set<std::vector<std::uint8_t>> colors;
    for (std::size_t i = 0; i < picture.pixels.size(); i += 3) {
      const bool is_left =
          static_cast<int>(i / 3) % picture.width < picture.width / 2;
      ASSERT_EQ(picture.pixels[i] > picture.pixels[i + 2], is_left);
      colors.insert(
          {picture.pixels[i], picture.pixels[i + 1], picture.pixels[i + 2]});
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
      const double u = texture.places(texture.corners(f, i), 0);
      ASSERT_EQ(u < 0.5, side >= 0);
    }
  }
  EXPECT_GE(texture.places.minCoeff(), 0);
  EXPECT_LE(texture.places.maxCoeff(), 1);
}

TEST(SampleTextureTest, VerticesHaveTheColourOfThePicture) {
  const absl::StatusOr<Sample> sample = MakeSample({'A', 500, 1});
  ASSERT_THAT(sample, IsOk());
  const Picture picture = SamplePicture(SamplePattern::kChecker);
  const Colors colors = SampleColors(*sample, SamplePattern::kChecker);
  int same = 0;
  for (VertexIndex v = 0; v < sample->mesh.num_vertices(); ++v) {
    const Eigen::RowVector2d place =
        SamplePlace(sample->rest.row(v), sample->rest(v, 1) >= 0);
    const auto column = static_cast<int>(place.x() * picture.width);
    const auto row = static_cast<int>((1 - place.y()) * picture.height);
    const std::size_t pixel =
        3 * static_cast<std::size_t>(row * picture.width + column);
    const auto bytes = ColorBytes(colors.row(v));
    same += bytes[0] == picture.pixels[pixel] &&
            bytes[1] == picture.pixels[pixel + 1] &&
            bytes[2] == picture.pixels[pixel + 2];
  }
  // All but those within a pixel of a square's rim.
  EXPECT_GT(same, 480);
}

}  // namespace
}  // namespace isomatch
