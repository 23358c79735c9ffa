#include "client/files/obj_file.h"

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "client/files/mesh_file.h"
#include "tests/support/matchers.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

using testing::ElementsAre;
using testing::EndsWith;
using testing::HasSubstr;

class ObjFileTest : public testing::Test {
 protected:
  absl::StatusOr<std::optional<MeshTexture>> Read(const std::string& text) {
    const std::string path = folder_.Write("a.obj", text);
    absl::StatusOr<LoadedMesh> loaded = ReadMesh(path, "Y");
    EXPECT_THAT(loaded, IsOk());
    mesh_ = loaded->mesh;
    return ReadObjTexture(path, mesh_);
  }
  TemporaryFolder folder_;
  TriangleMesh mesh_;
};

constexpr char kPoints[] = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";
constexpr char kPlaces[] = "vt 0 0\nvt 1 0\nvt 1 1 0\nvt 0 1\n";

TEST_F(ObjFileTest, QuadrilateralsAreCutAsTheMeshIs) {
  // The diagonal from 2 to 4 is shorter.
  const auto texture = Read("v 0 0 0\nv 1 0 0\nv 3 3 0\nv 0 1 0\n" +
                            std::string(kPlaces) + "f 1/1 2/2 3/3 4/4\n");
  ASSERT_THAT(texture, IsOk());
  ASSERT_TRUE(texture->has_value());
  EXPECT_EQ((*texture)->corners, mesh_.faces);
  EXPECT_EQ((*texture)->places.row(2), Eigen::RowVector2d(1, 1));
  EXPECT_THAT((*texture)->material_of_face, ElementsAre(-1, -1));
}

TEST_F(ObjFileTest, NumbersMayCountBackAndNormalsMayStandBeside) {
  const auto texture =
      Read(std::string(kPoints) + kPlaces +
           "vn 0 0 1\nf -4/-4/1 -3/-3/1 -2/-2/1\nf 1//1 3/3/1 4/4/1\n");
  ASSERT_THAT(texture, IsOk());
  EXPECT_EQ((*texture)->corners.row(0), Eigen::RowVector3i(0, 1, 2));
  EXPECT_EQ((*texture)->corners.row(1), Eigen::RowVector3i(-1, 2, 3));
}

TEST_F(ObjFileTest, MaterialsAreKept) {
  const auto texture =
      Read("mtllib my skin.mtl\n" + std::string(kPoints) + kPlaces +
           "usemtl red skin\nf 1/1 2/2 3/3\nusemtl blue\nf 1/1 3/3 4/4\n");
  ASSERT_THAT(texture, IsOk());
  EXPECT_THAT((*texture)->materials, ElementsAre("red skin", "blue"));
  EXPECT_THAT((*texture)->material_of_face, ElementsAre(0, 1));
  EXPECT_THAT((*texture)->libraries, ElementsAre(folder_.Path("my skin.mtl")));
}

TEST_F(ObjFileTest, FilesWithoutPlacesHaveNone) {
  EXPECT_EQ(*Read(std::string(kPoints) + "f 1 2 3\n"), std::nullopt);
  EXPECT_EQ(*Read(std::string(kPoints) + kPlaces + "f 1 2 3\n"), std::nullopt);
  EXPECT_EQ(*ReadObjTexture(folder_.Path("a.ply"), {}), std::nullopt);
}

TEST_F(ObjFileTest, TheSecondCoordinateMayBeLeftOut) {
  const auto texture = Read(std::string(kPoints) + "vt 0.5\nf 1/1 2/1 3/1\n");
  ASSERT_THAT(texture, IsOk());
  EXPECT_EQ((*texture)->places.row(0), Eigen::RowVector2d(0.5, 0));
}

TEST_F(ObjFileTest, WrongLinesAreNamed) {
  EXPECT_THAT(Read(std::string(kPoints) + kPlaces + "f 1/1 2/2 3/5\n"),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("line 9: a corner's texture coordinates are "
                                 "'3/5', expected V/VT with VT from 1 to 4")));
  EXPECT_THAT(Read(std::string(kPoints) + "vt\nf 1/1 2/1 3/1\n"),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("line 5: expected `vt u v`")));
  EXPECT_THAT(Read(std::string(kPoints) + "vt 0 nan\nf 1/1 2/1 3/1\n"),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("line 5: expected `vt u v`")));
}

TEST_F(ObjFileTest, WhatWeWriteComesBack) {
  auto texture =
      Read("mtllib skin.mtl\n" + std::string(kPoints) + kPlaces +
           "usemtl red\nf 1/1 2/2 3/3\nusemtl blue\nf 1/1 3/4 4/3\n");
  (*texture)->material_of_face.push_back(-1);
  (*texture)->corners.conservativeResize(3, Eigen::NoChange);
  (*texture)->corners.row(2).setConstant(-1);
  mesh_.faces.conservativeResize(3, Eigen::NoChange);
  mesh_.faces.row(2) << 0, 1, 3;
  const Colors colors = PositionColors(mesh_.positions);
  const std::string path = folder_.Path("b.obj");
  folder_.Write("b.obj", FormatObj(path, mesh_, {&**texture, &colors}));
  const absl::StatusOr<LoadedMesh> loaded = ReadMesh(path, "X");
  ASSERT_THAT(loaded, IsOk());
  EXPECT_EQ(loaded->mesh.positions, mesh_.positions);
  EXPECT_EQ(loaded->mesh.faces, mesh_.faces);
  const auto again = ReadObjTexture(path, loaded->mesh);
  ASSERT_THAT(again, IsOk());
  EXPECT_EQ((*again)->places, (*texture)->places);
  EXPECT_EQ((*again)->corners, (*texture)->corners);
  EXPECT_EQ((*again)->materials, (*texture)->materials);
  EXPECT_EQ((*again)->material_of_face, (*texture)->material_of_face);
  EXPECT_EQ((*again)->libraries, (*texture)->libraries);
  const auto again_colors = ReadVertexColors(path, 4);
  ASSERT_THAT(again_colors, IsOk());
  for (VertexIndex v = 0; v < 4; ++v) {
    EXPECT_EQ(ColorBytes((*again_colors)->row(v)), ColorBytes(colors.row(v)));
  }
}

TEST_F(ObjFileTest, LibrariesAreNamedFromTheNewFolder) {
  MeshTexture texture;
  texture.libraries = {"/data/y/skin.mtl"};
  texture.places.resize(0, 2);
  EXPECT_THAT(FormatObj("/data/x/b.obj", {}, {&texture, nullptr}),
              HasSubstr("mtllib ../y/skin.mtl\n"));
  EXPECT_THAT(FormatObj("/data/y/b.obj", {}, {&texture, nullptr}),
              HasSubstr("mtllib skin.mtl\n"));
  EXPECT_THAT(FormatObj("/data/x/../z/b.obj", {}, {&texture, nullptr}),
              HasSubstr("mtllib ../y/skin.mtl\n"));
  texture.libraries = {"skin.mtl"};
  EXPECT_THAT(FormatObj("../b.obj", {}, {&texture, nullptr}),
              EndsWith("/skin.mtl\n"));
  EXPECT_THAT(FormatObj("b.obj", {}, {&texture, nullptr}),
              EndsWith("mtllib skin.mtl\n"));
}

}  // namespace
}  // namespace isomatch
