#include "client/files/vertex_colors.h"

#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "client/files/mesh_file.h"
#include "tests/support/matchers.h"
#include "tests/support/shapes.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

class VertexColorsTest : public testing::Test {
 protected:
  /// Colors of a file that ReadMesh reads too, with three vertices.
  absl::StatusOr<std::optional<Colors>> Read(const std::string& name,
                                             const std::string& text) {
    const std::string path = folder_.Write(name, text);
    const absl::StatusOr<LoadedMesh> loaded = ReadMesh(path, "Y");
    EXPECT_THAT(loaded, IsOk());
    EXPECT_EQ(loaded->mesh.num_vertices(), 3);
    return ReadVertexColors(path, 3);
  }
  /// Red, half green, blue.
  void ExpectColors(const absl::StatusOr<std::optional<Colors>>& found) {
    ASSERT_THAT(found, IsOk());
    ASSERT_TRUE(found->has_value());
    ASSERT_EQ((*found)->rows(), 3);
    EXPECT_THAT(ColorBytes((*found)->row(0)), ElementsAre(255, 0, 0));
    EXPECT_THAT(ColorBytes((*found)->row(1)), ElementsAre(0, 128, 0));
    EXPECT_THAT(ColorBytes((*found)->row(2)), ElementsAre(0, 0, 255));
  }
  TemporaryFolder folder_;
};

TEST_F(VertexColorsTest, PlyHasThemAsBytesOrFractions) {
  const auto ply = [](const std::string& type, const std::string& half,
                      const std::string& one) {
    return "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\n"
           "property float y\nproperty float z\nproperty " +
           type + " red\nproperty " + type + " green\nproperty " + type +
           " blue\nelement face 1\nproperty list uchar int vertex_indices\n"
           "end_header\n0 0 0 " +
           one + " 0 0\n1 0 0 0 " + half + " 0\n0 1 0 0 0 " + one +
           "\n3 0 1 2\n";
  };
  ExpectColors(Read("a.ply", ply("uchar", "128", "255")));
  ExpectColors(Read("b.ply", ply("float", "0.5", "1")));
  ExpectColors(Read("c.ply", ply("ushort", "32768", "65535")));
}

TEST_F(VertexColorsTest, WhatWeWriteComesBack) {
  const TriangleMesh mesh = Tetrahedron();
  const Colors colors = PositionColors(mesh.positions);
  const std::string path =
      folder_.Write("a.ply", FormatPly(mesh, ColorColumns(colors)));
  ASSERT_THAT(ReadMesh(path, "Y"), IsOk());
  const auto found = ReadVertexColors(path, mesh.num_vertices());
  ASSERT_TRUE(found.ok() && found->has_value());
  for (VertexIndex v = 0; v < mesh.num_vertices(); ++v) {
    EXPECT_EQ(ColorBytes((*found)->row(v)), ColorBytes(colors.row(v)));
  }
}

TEST_F(VertexColorsTest, ObjHasThemAsFractionsOrBytes) {
  ExpectColors(Read("a.obj",
                    "v 0 0 0 1 0 0\nv 1 0 0 0 0.5 0\n"
                    "v 0 1 0 0 0 1\nvt 0 0\nvn 0 0 1\nf 1 2 3\n"));
  ExpectColors(Read("b.obj",
                    "v 0 0 0 255 0 0\nv 1 0 0 0 128 0\n"
                    "v 0 1 0 0 0 255\nf 1 2 3\n"));
}

TEST_F(VertexColorsTest, OffHasThemAfterTheCoordinates) {
  ExpectColors(Read("a.off",
                    "COFF\n# a comment\n3 1 0\n0 0 0 255 0 0 255\n"
                    "1 0 0 0 128 0 255\n\n0 1 0 0 0 255 255\n3 0 1 2\n"));
  ExpectColors(Read("b.off",
                    "COFF\n3 1 0\n0 0 0 1.0 0 0 1\n1 0 0 0 0.5 0 1\n"
                    "0 1 0 0 0 1.0 1\n3 0 1 2\n"));
}

TEST_F(VertexColorsTest, FilesWithoutThemHaveNone) {
  EXPECT_EQ(*Read("a.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"),
            std::nullopt);
  EXPECT_EQ(*Read("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
            std::nullopt);
  const std::string path = folder_.Write("a.ply", FormatPly(Tetrahedron()));
  EXPECT_EQ(*ReadVertexColors(path, 4), std::nullopt);
}

TEST_F(VertexColorsTest, HalfAColoringIsRefused) {
  EXPECT_THAT(Read("a.obj", "v 0 0 0 1 0 0\nv 1 0 0\nv 0 1 0 0 0 1\nf 1 2 3\n"),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("1 of 3 vertices have no color")));
  EXPECT_THAT(
      Read("a.obj", "v 0 0 0 1 0 0\nv 1 0 0 0 x 0\nv 0 1 0 0 0 1\nf 1 2 3\n"),
      StatusIs(absl::StatusCode::kInvalidArgument,
               HasSubstr("line 2: a vertex's color is 'x'")));
}

TEST(PositionColorsTest, AreThoseOfThePage) {
  const TriangleMesh body = MirrorSymmetricBody(2);
  const Colors colors = PositionColors(body.positions);
  const std::vector<Rgb> bytes = PlaceColors(body.positions);
  for (VertexIndex v = 0; v < body.num_vertices(); ++v) {
    EXPECT_EQ(ColorBytes(colors.row(v)), bytes[static_cast<std::size_t>(v)]);
  }
  EXPECT_EQ(ColorBytes(kNoColor), kGray);
}

}  // namespace
}  // namespace isomatch
