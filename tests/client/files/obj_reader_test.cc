#include "client/files/obj_reader.h"

#include <optional>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "client/files/mesh_file.h"
#include "tests/support/matchers.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr char kPoints[] = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";
constexpr char kPlaces[] = "vt 0 0\nvt 1 0\nvt 1 1 0\nvt 0 1\n";
// Two triangles of four vertices.
const std::string kSquare = kPoints + std::string("f 1 2 3\nf -4 3 4\n");

/// What ReadMesh makes of an OBJ file.
class ObjReaderTest : public testing::Test {
 protected:
  absl::StatusOr<LoadedMesh> Read(const std::string& text) {
    return ReadMesh(folder_.Write("a.obj", text), "Y");
  }
  absl::Status Error(const std::string& text) { return Read(text).status(); }
  /// Of a file whose mesh is good.
  absl::StatusOr<std::optional<MeshTexture>> Texture(const std::string& text) {
    const absl::StatusOr<LoadedMesh> loaded = Read(text);
    EXPECT_THAT(loaded, IsOk());
    mesh_ = loaded->mesh;
    return loaded->texture;
  }
  auto Refused(const std::string& why) {
    return StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr(why));
  }
  TemporaryFolder folder_;
  TriangleMesh mesh_;
};

TEST_F(ObjReaderTest, AByteOrderMarkHidesNoVertex) {
  const auto loaded = Read(std::string("\xEF\xBB\xBF") + kSquare);
  ASSERT_THAT(loaded, IsOk());
  EXPECT_TRUE(loaded->warnings.empty());
  EXPECT_EQ(loaded->mesh.num_vertices(), 4);
  EXPECT_THAT(Error("v 0x10 0 0\n"), Refused("line 1: a coordinate is '0x10'"));
}

// What modelling programs write beside the surface.
TEST_F(ObjReaderTest, ObjStatementsThatAreNoSurfaceAreLeftOut) {
  const absl::StatusOr<LoadedMesh> loaded =
      Read("mtllib a.mtl\no Cube\ng side\ns off\nusemtl None\n" + kSquare +
           "l 1 2\np 3 4\nvt 0 0\nvp 1 2\nl -1 -2\n");
  ASSERT_THAT(loaded, IsOk());
  EXPECT_EQ(loaded->mesh.num_vertices(), 4);
  EXPECT_EQ(loaded->mesh.num_faces(), 2);
  EXPECT_THAT(loaded->warnings, IsEmpty());
}

TEST_F(ObjReaderTest, ObjLinesGoOnAfterABackslash) {
  const absl::StatusOr<LoadedMesh> loaded = Read(
      "v 0 \\\n0 0\r\nv 1 0 0\nv 1 1 0\nv 0 1 0 # \\\nf 1 2 \\\r\n 3 \\\n"
      "4\n# \\\nf 1 2 4\\");
  ASSERT_THAT(loaded, IsOk());
  EXPECT_EQ(loaded->mesh.num_vertices(), 4);
  EXPECT_EQ(loaded->mesh.num_faces(), 3);
  EXPECT_THAT(Error("v 0 \\\n0 0\nv 1 \\\n 0\nf 1 2 3\n"),
              Refused("line 3: a vertex has 2"));
}

TEST_F(ObjReaderTest, WhatObjDoesNotHaveIsTold) {
  const absl::StatusOr<LoadedMesh> loaded =
      Read("hello world\n" + kSquare + "curv 0 1 1 2\nx\n");
  ASSERT_THAT(loaded, IsOk());
  EXPECT_THAT(loaded->warnings,
              ElementsAre(HasSubstr("1 lines of free-form curves"),
                          HasSubstr("2 lines that are no statements "
                                    "of OBJ are left out, first "
                                    "'hello' in line 1")));
}

TEST_F(ObjReaderTest, QuadrilateralsAreCutAsTheMeshIs) {
  // The diagonal from 2 to 4 is shorter.
  const auto texture = Texture("v 0 0 0\nv 1 0 0\nv 3 3 0\nv 0 1 0\n" +
                               std::string(kPlaces) + "f 1/1 2/2 3/3 4/4\n");
  ASSERT_THAT(texture, IsOk());
  ASSERT_TRUE(texture->has_value());
  EXPECT_EQ((*texture)->corners, mesh_.faces);
  EXPECT_EQ((*texture)->coordinates.row(2), Eigen::RowVector2d(1, 1));
  EXPECT_THAT((*texture)->material_of_face, ElementsAre(-1, -1));
}

TEST_F(ObjReaderTest, NumbersMayCountBackAndNormalsMayStandBeside) {
  const auto texture =
      Texture(std::string(kPoints) + kPlaces +
              "vn 0 0 1\nf -4/-4/1 -3/-3/1 -2/-2/1\nf 1//1 3/3/1 4/4/1\n");
  ASSERT_THAT(texture, IsOk());
  EXPECT_EQ((*texture)->corners.row(0), Eigen::RowVector3i(0, 1, 2));
  EXPECT_EQ((*texture)->corners.row(1), Eigen::RowVector3i(-1, 2, 3));
}

TEST_F(ObjReaderTest, MaterialsAreKept) {
  const auto texture =
      Texture("mtllib my skin.mtl\n" + std::string(kPoints) + kPlaces +
              "usemtl red skin\nf 1/1 2/2 3/3\nusemtl blue\nf 1/1 3/3 4/4\n");
  ASSERT_THAT(texture, IsOk());
  EXPECT_THAT((*texture)->materials, ElementsAre("red skin", "blue"));
  EXPECT_THAT((*texture)->material_of_face, ElementsAre(0, 1));
  EXPECT_THAT((*texture)->libraries, ElementsAre(folder_.Path("my skin.mtl")));
}

TEST_F(ObjReaderTest, FacesBeforeTheFirstPlaceOrMaterialHaveNone) {
  const auto texture =
      Texture(std::string(kPoints) + kPlaces +
              "f 1 2 3\nusemtl red\nf 1/1 3/3 4/4\nusemtl (none)\nf 2 3 4\n");
  ASSERT_THAT(texture, IsOk());
  ASSERT_EQ((*texture)->corners.rows(), 3);
  EXPECT_EQ((*texture)->corners.row(0), Eigen::RowVector3i(-1, -1, -1));
  EXPECT_EQ((*texture)->corners.row(1), Eigen::RowVector3i(0, 2, 3));
  EXPECT_EQ((*texture)->corners.row(2), Eigen::RowVector3i(-1, -1, -1));
  EXPECT_THAT((*texture)->material_of_face, ElementsAre(-1, 0, -1));
}

TEST_F(ObjReaderTest, FilesWithoutPlacesHaveNone) {
  EXPECT_EQ(*Texture(std::string(kPoints) + "f 1 2 3\n"), std::nullopt);
  EXPECT_EQ(*Texture(std::string(kPoints) + kPlaces + "f 1 2 3\n"),
            std::nullopt);
}

TEST_F(ObjReaderTest, TheSecondCoordinateMayBeLeftOut) {
  const auto texture =
      Texture(std::string(kPoints) + "vt 0.5\nf 1/1 2/1 3/1\n");
  ASSERT_THAT(texture, IsOk());
  EXPECT_EQ((*texture)->coordinates.row(0), Eigen::RowVector2d(0.5, 0));
}

TEST_F(ObjReaderTest, AWrongTextureIsNoWrongMesh) {
  EXPECT_THAT(Texture(std::string(kPoints) + kPlaces + "f 1/1 2/2 3/5\n"),
              Refused("a.obj', line 9: a corner's texture coordinates are "
                      "'3/5', expected V/VT with VT from 1 to 4"));
  EXPECT_THAT(Texture(std::string(kPoints) + kPlaces + "f 1/1 2/-5 3/9\n"),
              Refused("line 9: a corner's texture coordinates are '2/-5'"));
  EXPECT_THAT(Texture(std::string(kPoints) + "f 1/1 2/1 3/1\nvt 0 0\n"),
              Refused("line 5: a corner's texture coordinates are '1/1', "
                      "expected V/VT with VT from 1 to 0"));
  EXPECT_THAT(Texture(std::string(kPoints) + "vt\nf 1/1 2/1 3/1\n"),
              Refused("line 5: expected `vt u v`"));
  EXPECT_THAT(Texture(std::string(kPoints) + "vt 0 nan\nf 1/1 2/1 3/1\n"),
              Refused("line 5: expected `vt u v`"));
}

TEST_F(ObjReaderTest, NumbersOfVerticesBeyondAllMeshesAreRefused) {
  EXPECT_THAT(Error(std::string(kPoints) + "f 1 2 2147483648\n"),
              Refused("line 5: a face's corner is '2147483648', expected V, "
                      "V/VT, V//VN or V/VT/VN with V from 1 to 2147483647"));
  EXPECT_THAT(Error(std::string(kPoints) + "f 1 2 2147483647\n"),
              Refused("line 5: a face names vertex 2147483647, expected 1 to "
                      "4"));
}

}  // namespace
}  // namespace isomatch
