#include "client/files/obj_file.h"

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "client/files/mesh_file.h"
#include "client/files/vertex_colors.h"
#include "tests/support/matchers.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

using testing::EndsWith;
using testing::HasSubstr;

TEST(ObjFileTest, WhatWeWriteComesBack) {
  const TemporaryFolder folder;
  TriangleMesh mesh = {Positions(4, 3), Faces(3, 3)};
  mesh.positions << 0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0;
  mesh.faces << 0, 1, 2, 0, 2, 3, 0, 1, 3;
  MeshTexture texture;
  texture.coordinates.resize(4, 2);
  texture.coordinates << 0, 0, 1, 0, 1, 1, 0.1, 1;
  texture.corners.resize(3, 3);
  texture.corners << 0, 1, 2, 0, 3, 2, -1, -1, -1;
  texture.materials = {"red", "light blue"};
  texture.material_of_face = {0, 1, -1};
  texture.libraries = {folder.Path("my skin.mtl")};
  const Colors colors = PositionColors(mesh);
  const std::string path = folder.Path("b.obj");
  folder.Write("b.obj", FormatObj(path, mesh, {&texture, &colors}));
  const absl::StatusOr<LoadedMesh> loaded = ReadMesh(path, "X");
  ASSERT_THAT(loaded, IsOk());
  EXPECT_EQ(loaded->mesh.positions, mesh.positions);
  EXPECT_EQ(loaded->mesh.faces, mesh.faces);
  ASSERT_TRUE(loaded->texture.ok() && loaded->texture->has_value());
  const MeshTexture& again = **loaded->texture;
  EXPECT_EQ(again.coordinates, texture.coordinates);
  EXPECT_EQ(again.corners, texture.corners);
  EXPECT_EQ(again.materials, texture.materials);
  EXPECT_EQ(again.material_of_face, texture.material_of_face);
  EXPECT_EQ(again.libraries, texture.libraries);
  ASSERT_TRUE(loaded->colors.ok() && loaded->colors->has_value());
  for (VertexIndex v = 0; v < 4; ++v) {
    EXPECT_EQ(ColorBytes((*loaded->colors)->row(v)), ColorBytes(colors.row(v)));
  }
}

TEST(ObjFileTest, LibrariesAreNamedFromTheNewFolder) {
  MeshTexture texture;
  texture.libraries = {"/data/y/skin.mtl"};
  texture.coordinates.resize(0, 2);
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
