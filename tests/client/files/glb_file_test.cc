#include "client/files/glb_file.h"

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "client/files/material_pictures.h"
#include "client/files/obj_file.h"
#include "tests/support/matchers.h"
#include "tests/support/shapes.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

// A tetrahedron whose faces lie apart in a picture, of two materials, and one
// face without coordinates.
constexpr char kTexturedObj[] =
    "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n"
    "vt 0 0\nvt 0.5 0\nvt 0.5 0.5\nvt 1 1\nvt 0.25 0.75\n"
    "usemtl skin\nf 1/1 3/2 2/3\nf 1/4 2/5 4/1\n"
    "usemtl fur\nf 2/1 3/2 4/3\nf 1 4 3\n";

class GlbFileTest : public testing::Test {
 protected:
  LoadedMesh ReadBack(const std::string& bytes) {
    auto loaded = ReadMesh(folder_.Write("out.glb", bytes), "OUT");
    EXPECT_THAT(loaded, IsOk());
    return *std::move(loaded);
  }
  TemporaryFolder folder_;
};

TEST_F(GlbFileTest, AMeshComesBackInItsOrder) {
  const TriangleMesh mesh = BumpySphere(3);
  const LoadedMesh back = ReadBack(FormatGlb(mesh, {}));
  EXPECT_EQ(back.mesh.faces, mesh.faces);
  EXPECT_EQ(back.mesh.positions, mesh.positions.cast<float>().cast<double>());
  EXPECT_EQ(FormatGlb(mesh, {}), FormatGlb(mesh, {}));
}

TEST_F(GlbFileTest, ColorsComeBackToTheByte) {
  const TriangleMesh mesh = UnitSphere(2);
  Colors colors(mesh.num_vertices(), 3);
  for (Eigen::Index i = 0; i < colors.size(); ++i) {
    colors.data()[i] = static_cast<double>(i % 256) / 255;
  }
  const LoadedMesh back = ReadBack(FormatGlb(mesh, {nullptr, &colors}));
  EXPECT_LT((**back.colors - colors).cwiseAbs().maxCoeff(), 0.2 / 255);
}

TEST_F(GlbFileTest, TheFirstVerticesAreTheMeshsAndSeamsAreCopies) {
  folder_.Write("a.mtl",
                "newmtl skin\nmap_Kd -s 1 1 1 skin.png\n"
                "newmtl fur\nmap_kd dark fur.jpg\n");
  folder_.Write("skin.png", "\x89PNG of skin");
  folder_.Write("dark fur.jpg", "\xff\xd8\xff of fur");
  const LoadedMesh obj = *ReadMesh(folder_.Write("a.obj", kTexturedObj), "Y");
  const MeshTexture& texture = **obj.texture;
  std::vector<std::string> warnings;
  const std::vector<std::string> pictures =
      MaterialPictures(texture, &warnings);
  EXPECT_THAT(pictures, ElementsAre("\x89PNG of skin", "\xff\xd8\xff of fur"));
  EXPECT_THAT(warnings, IsEmpty());
  const std::string bytes = FormatGlb(obj.mesh, {&texture, nullptr, pictures});
  EXPECT_EQ(bytes, FormatGlb(obj.mesh, {&texture, nullptr, pictures}));
  EXPECT_THAT(bytes, HasSubstr("\"mimeType\":\"image/jpeg\""));
  const LoadedMesh back = ReadBack(bytes);
  EXPECT_EQ(back.mesh.positions.topRows(4), obj.mesh.positions);
  // The face without coordinates comes first.
  ASSERT_EQ(back.mesh.num_faces(), 4);
  EXPECT_EQ(back.mesh.faces.row(0), obj.mesh.faces.row(3));
  const MeshTexture& found = **back.texture;
  EXPECT_THAT(found.material_of_face, ElementsAre(-1, 0, 0, 1));
  EXPECT_THAT(found.materials, ElementsAre("skin", "fur"));
  EXPECT_EQ(found.images[0].bytes, "\x89PNG of skin");
  for (int f = 0; f < 3; ++f) {
    for (int i = 0; i < 3; ++i) {
      EXPECT_EQ(back.mesh.positions.row(back.mesh.faces(f + 1, i)),
                obj.mesh.positions.row(obj.mesh.faces(f, i)));
      EXPECT_EQ(found.coordinates.row(found.corners(f + 1, i)),
                texture.coordinates.row(texture.corners(f, i)));
    }
  }
}

TEST_F(GlbFileTest, PicturesThatCannotBeHadAreToldOf) {
  folder_.Write("a.mtl",
                "newmtl skin\nmap_Kd none.png\n"
                "newmtl fur\nmap_Kd fur.bmp\n");
  folder_.Write("fur.bmp", "BM");
  const LoadedMesh obj = *ReadMesh(folder_.Write("a.obj", kTexturedObj), "Y");
  std::vector<std::string> warnings;
  EXPECT_THAT(MaterialPictures(**obj.texture, &warnings), ElementsAre("", ""));
  EXPECT_THAT(warnings,
              ElementsAre(HasSubstr("none.png': no such file"),
                          HasSubstr("fur.bmp' is neither PNG nor JPEG")));
}

}  // namespace
}  // namespace isomatch
