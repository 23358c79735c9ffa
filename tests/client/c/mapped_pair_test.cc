#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <numeric>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "client/c/isomatch.h"
#include "core/mesh/triangle_mesh.h"
#include "tests/support/shapes.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

using testing::ElementsAreArray;
using testing::HasSubstr;
using testing::StrEq;

/// A sphere, itself, and the map that leaves all where it is.
class MappedPairTest : public testing::Test {
 protected:
  MappedPairTest() : map_(static_cast<std::size_t>(sphere_.num_vertices())) {
    std::iota(map_.begin(), map_.end(), 0);
  }

  ~MappedPairTest() override {
    isomatch_error_free(error_);
    isomatch_text_free(page_);
  }

  isomatch_status MakePage(const isomatch_page* page = nullptr,
                           const std::uint8_t* mask_y = nullptr) {
    isomatch_text_free(page_);
    isomatch_error_free(error_);
    return mask_y == nullptr ? isomatch_page_make(&pair_, page, &page_, &error_)
                             : isomatch_page_make_masked(&pair_, page, mask_y,
                                                         &page_, &error_);
  }

  void ExpectInvalid(const std::string& field, const std::string& text) {
    EXPECT_EQ(MakePage(), ISOMATCH_INVALID_ARGUMENT);
    EXPECT_EQ(page_, nullptr);
    EXPECT_THAT(isomatch_error_field(error_), StrEq(field));
    EXPECT_THAT(isomatch_error_message(error_), HasSubstr(text));
  }

  const TriangleMesh sphere_ = BumpySphere(3);
  const isomatch_mesh borrowed_ = {sphere_.positions.data(),
                                   sphere_.num_vertices(), sphere_.faces.data(),
                                   sphere_.num_faces()};
  std::vector<std::int32_t> map_;
  isomatch_mapped_pair pair_ = {&borrowed_, &borrowed_, map_.data(), nullptr,
                                nullptr};
  isomatch_text* page_ = nullptr;
  isomatch_error* error_ = nullptr;
};

TEST_F(MappedPairTest, APageIsOneDocument) {
  const std::vector<float> confidence(map_.size(), 0.5F);
  const isomatch_page page = {"A < B", "left.off", "right.off",
                              confidence.data(),
                              R"({"verdict": {"level": "good"}})"};
  ASSERT_EQ(MakePage(&page), ISOMATCH_OK) << isomatch_error_message(error_);
  const std::string html = isomatch_text_data(page_);
  EXPECT_EQ(isomatch_text_size(page_), static_cast<std::int64_t>(html.size()));
  EXPECT_THAT(html, HasSubstr("left.off"));
  EXPECT_THAT(html, HasSubstr("\"level\":\"good\""));
  EXPECT_THAT(html, HasSubstr("\"id\":\"confidence\""));
  EXPECT_THAT(html, HasSubstr("</html>"));
  ASSERT_EQ(MakePage(), ISOMATCH_OK);  // all that is optional left out
}

TEST_F(MappedPairTest, FiguresOfAPageLeaveOutWhatHasNoImage) {
  std::vector<float> confidence(map_.size(), 0.75F);
  for (std::size_t v = 0; v < map_.size() / 2; ++v) {
    map_[v] = -1;
    confidence[v] = 0;
  }
  std::vector<std::uint8_t> mask(sphere_.num_vertices(), 1);
  mask[3] = 0;
  const isomatch_page page = {nullptr, nullptr, nullptr, confidence.data(),
                              nullptr};
  ASSERT_EQ(MakePage(&page, mask.data()), ISOMATCH_OK)
      << isomatch_error_message(error_);
  EXPECT_THAT(isomatch_text_data(page_),
              HasSubstr(R"(["mean confidence","0.75"])"));
  EXPECT_THAT(
      isomatch_text_data(page_),
      HasSubstr(R"(["vertices of Y with a counterpart","641 of 642"])"));
}

TEST_F(MappedPairTest, WrongMapsAreNamed) {
  map_[7] = sphere_.num_vertices();
  ExpectInvalid("map[7]", "642, expected a vertex of Y, 0 to 641, or -1");
  map_[7] = -2;
  ExpectInvalid("map[7]", "-2");
  map_[7] = -1;  // none
  EXPECT_EQ(MakePage(), ISOMATCH_OK);
  std::vector<std::int32_t> corners(3 * map_.size(), 5);
  std::vector<double> weights(3 * map_.size(), 1.0 / 3);
  pair_.precise_vertices = corners.data();
  ExpectInvalid("precise_weights", "expected both or none");
  pair_.precise_weights = weights.data();
  weights[4] = 0.9;
  ExpectInvalid("precise_weights[3]", "expected 1");
  weights[4] = std::numeric_limits<double>::quiet_NaN();
  ExpectInvalid("precise_weights[4]", "expected 0 to 1");
  corners[11] = 9999;
  weights[4] = 1.0 / 3;
  ExpectInvalid("precise_vertices[11]", "9999");
  pair_.map = nullptr;
  ExpectInvalid("map", "NULL");
  pair_.mesh_y = nullptr;
  ExpectInvalid("mesh_y", "NULL");
}

TEST_F(MappedPairTest, AReportOfOtherMeshesIsRefused) {
  const isomatch_page page = {nullptr, nullptr, nullptr, nullptr,
                              R"({"mesh_x": {"vertices": 3}})"};
  EXPECT_EQ(MakePage(&page), ISOMATCH_INVALID_ARGUMENT);
  EXPECT_THAT(isomatch_error_message(error_), HasSubstr("mesh_x.vertices"));
}

/// Coordinates that differ at every vertex.
std::vector<double> Unwrapped(const TriangleMesh& mesh) {
  std::vector<double> uv;
  for (Eigen::Index corner = 0; corner < mesh.faces.size(); ++corner) {
    const auto place = mesh.positions.row(mesh.faces(corner / 3, corner % 3));
    uv.insert(uv.end(), {place.x() + 2 * place.z(), place.y() - place.z()});
  }
  return uv;
}

TEST_F(MappedPairTest, TheIdentityLeavesTextureCoordinates) {
  std::vector<double> uv = Unwrapped(sphere_);
  std::vector<double> carried(uv.size(), -1);
  ASSERT_EQ(isomatch_carry_texture(&pair_, uv.data(), carried.data(), &error_),
            ISOMATCH_OK);
  EXPECT_THAT(carried, ElementsAreArray(uv));
  // Vertices of X that lie nowhere leave their faces without.
  map_[0] = -1;
  ASSERT_EQ(isomatch_carry_texture(&pair_, uv.data(), carried.data(), &error_),
            ISOMATCH_OK);
  for (Eigen::Index f = 0; f < sphere_.num_faces(); ++f) {
    EXPECT_EQ(std::isnan(carried[static_cast<std::size_t>(6 * f)]),
              (sphere_.faces.row(f).array() == 0).any());
  }
  EXPECT_EQ(isomatch_carry_texture(&pair_, nullptr, carried.data(), nullptr),
            ISOMATCH_INVALID_ARGUMENT);
}

TEST(MeshFileTest, HasWhatTheFileHas) {
  const TemporaryFolder folder;
  const std::string path = folder.Write(
      "square.off", "OFF 4 1 0\n0 0 0\n2 0 0\n2 1 0.5\n0 1 0\n4 0 1 2 3\n");
  isomatch_mesh_file* file = nullptr;
  ASSERT_EQ(isomatch_mesh_file_read(path.c_str(), &file, nullptr), ISOMATCH_OK);
  const isomatch_mesh* const mesh = isomatch_mesh_file_mesh(file);
  EXPECT_EQ(mesh->num_vertices, 4);
  EXPECT_EQ(mesh->positions[8], 0.5);
  ASSERT_EQ(mesh->num_faces, 2);
  EXPECT_EQ(isomatch_mesh_file_num_warnings(file), 1);
  EXPECT_THAT(isomatch_mesh_file_warning(file, 0), HasSubstr("triangles"));
  EXPECT_EQ(isomatch_mesh_file_warning(file, 1), nullptr);
  isomatch_mesh_file_free(file);
}

TEST(MeshFileTest, ErrorsNameFileAndLine) {
  const TemporaryFolder folder;
  const std::string path =
      folder.Write("word.off", "OFF\n3 1 0\n0 0 0\n1 tall 0\n1 1 0\n3 0 1 2\n");
  isomatch_mesh_file* file = nullptr;
  isomatch_error* error = nullptr;
  for (const auto& [name, said] :
       {std::pair(path, "line 4"),
        std::pair(folder.Write("mesh.doc", "OFF"), ".stl"),
        std::pair(folder.Path("none.off"), "no such file")}) {
    EXPECT_EQ(isomatch_mesh_file_read(name.c_str(), &file, &error),
              ISOMATCH_INVALID_ARGUMENT);
    EXPECT_EQ(file, nullptr);
    EXPECT_THAT(isomatch_error_field(error), StrEq("path"));
    EXPECT_THAT(isomatch_error_message(error), HasSubstr(said));
    EXPECT_THAT(isomatch_error_message(error), HasSubstr(name));
    isomatch_error_free(error);
  }
  EXPECT_EQ(isomatch_mesh_file_read(nullptr, &file, nullptr),
            ISOMATCH_INVALID_ARGUMENT);
  isomatch_mesh_file_free(nullptr);
}

}  // namespace
}  // namespace isomatch
