#include "client/job/part_files.h"

#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "client/files/face_finder.h"
#include "tests/support/matchers.h"
#include "tests/support/shapes.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

/// Two triangles on both sides of a seam: vertices 3 and 4 lie where 1 and 2
/// do, as far as single precision tells.
TriangleMesh WithSeam() {
  TriangleMesh mesh;
  mesh.positions.resize(6, 3);
  mesh.positions << 0, 1, 0,  //
      1, 1, 0,                //
      1, 0, 0,                //
      1, 1 + 1e-12, 0,        //
      1, 0, 0,                //
      2, 0, 0;
  mesh.faces.resize(2, 3);
  mesh.faces << 0, 1, 2, 4, 3, 5;
  return mesh;
}

TEST(FaceFinderTest, WeightsFollowTheFilesOrder) {
  const TriangleMesh mesh = WithSeam();
  const SurfacePoint found =
      FaceFinder(mesh).Find({{5, 4, 3}, {0.5, 0.3, 0.2}});
  EXPECT_EQ(found.face, 1);
  EXPECT_THAT(found.weights, ElementsAre(0.3, 0.2, 0.5));
}

TEST(FaceFinderTest, AWeldedSeamIsFoundByItsPlaces) {
  const TriangleMesh mesh = WithSeam();
  const SurfacePoint found =
      FaceFinder(mesh).Find({{1, 2, 5}, {0.5, 0.3, 0.2}});
  EXPECT_EQ(found.face, 1);
  EXPECT_THAT(found.weights, ElementsAre(0.3, 0.5, 0.2));
}

TEST(FaceFinderTest, OtherwiseTheHeaviestVertexStandsForThePoint) {
  const TriangleMesh mesh = WithSeam();
  const SurfacePoint found =
      FaceFinder(mesh).Find({{0, 1, 5}, {0.2, 0.2, 0.6}});
  EXPECT_EQ(found.face, 1);
  EXPECT_THAT(found.weights, ElementsAre(0, 0, 1));
}

TEST(FaceFinderTest, NoPlaceHasNoFace) {
  TriangleMesh mesh = WithSeam();
  mesh.positions.conservativeResize(7, Eigen::NoChange);
  mesh.positions.row(6).setConstant(9);  // on no face
  EXPECT_EQ(FaceFinder(mesh).Find({}).face, kNoVertex);
  EXPECT_EQ(FaceFinder(mesh).Find({{0, 1, 6}, {0, 0, 1}}).face, kNoVertex);
}

TEST(FaceFinderTest, EveryFaceFindsItself) {
  const TriangleMesh mesh = UnitSphere(3);
  const FaceFinder finder(mesh);
  for (VertexIndex f = 0; f < mesh.num_faces(); ++f) {
    const SurfacePoint found = finder.Find(
        {{mesh.faces(f, 1), mesh.faces(f, 2), mesh.faces(f, 0)}, {0, 0, 1}});
    ASSERT_EQ(found.face, f);
    ASSERT_EQ(found.weights[0], 1);
  }
}

TEST(PartFilesTest, APreciseMapHasALineForEachVertex) {
  EXPECT_EQ(
      FormatPreciseMap(
          std::vector<PrecisePoint>{
              {{0, 1, 2}, {0.5, 0.25, 0.25}}, {}, {{1, 2, 0}, {0.1f, 0.9f, 0}}},
          WithSeam()),
      "0 0.5 0.25 0.25\n-1 0 0 0\n0 0 0.1 0.9\n");
}

TEST(PartFilesTest, ConfidenceIsOneNumberALine) {
  EXPECT_EQ(FormatConfidence(std::vector<float>{1, 0.1f, 0}), "1\n0.1\n0\n");
}

TEST(PartFilesTest, AMaskIsOneOrZeroALine) {
  EXPECT_EQ(FormatMask(std::vector<char>{1, 0, 1}), "1\n0\n1\n");
}

TEST(PartFilesTest, AMaskIsZeroOrOneALine) {
  const TemporaryFolder folder;
  EXPECT_THAT(*ReadMaskY(folder.Write("m", "1\n0\r\n\n# rim\n1\n"), 3),
              ElementsAre(1, 0, 1));
  const auto refused = [&](const std::string& text, const std::string& why) {
    EXPECT_THAT(ReadMaskY(folder.Write("m", text), 3),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr(why)));
  };
  refused("1\n0\n", "2 lines, expected 3, one for each vertex of Y");
  refused("1\n2\n0\n", "line 2: found '2', expected 0 or 1");
  refused("1\n0 1\n0\n", "line 2: found '0 1', expected 0 or 1");
  EXPECT_THAT(ReadMaskY(folder.Path("none"), 3),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("none")));
}

TEST(PartFilesTest, AFunctionalMapIsJsonByRows) {
  FunctionalMap map;
  map.eigenvalues_x = Eigen::Vector2d(0, 0.1);
  map.eigenvalues_y = Eigen::Vector2d(0, 7);
  map.fmap_x_from_y.resize(2, 2);
  map.fmap_x_from_y << 1, 2, 3, 4;
  EXPECT_EQ(nlohmann::json::parse(FormatFunctionalMap(map)),
            nlohmann::json::parse(R"({"eigenvalues_x": [0.0, 0.1],
                                      "eigenvalues_y": [0.0, 7.0],
                                      "matrix": [[1.0, 2.0], [3.0, 4.0]]})"));
}

}  // namespace
}  // namespace isomatch
