#include "client/files/place_file.h"

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "client/files/map_file.h"
#include "client/files/named_vertices.h"
#include "tests/support/matchers.h"
#include "tests/support/shapes.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

class PlaceFileTest : public testing::Test {
 protected:
  absl::StatusOr<PlacesOnY> Read(const std::string& name,
                                 const std::string& text, VertexIndex rows) {
    return ReadPlaces(folder_.Write(name, text), rows, mesh_);
  }
  void ExpectRefused(const std::string& text, const std::string& why) {
    EXPECT_THAT(Read("p.txt", text, 2),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr(why)));
  }
  const TriangleMesh mesh_ = Tetrahedron();
  TemporaryFolder folder_;
};

TEST_F(PlaceFileTest, PrecisePlacesNameTheVerticesOfTheirFace) {
  const auto places =
      Read("p.txt", "# precise\n2 0.5 0.25 0.25\n-1 0 0 0\n", 2);
  ASSERT_THAT(places, IsOk());
  EXPECT_TRUE(places->is_precise);
  EXPECT_THAT(
      places->points[0].vertices,
      ElementsAre(mesh_.faces(2, 0), mesh_.faces(2, 1), mesh_.faces(2, 2)));
  EXPECT_THAT(places->points[0].weights, ElementsAre(0.5, 0.25, 0.25));
  EXPECT_EQ(places->points[1].vertices[0], kNoVertex);
}

TEST_F(PlaceFileTest, RoundedWeightsAreThoseOfAPointOnTheFace) {
  const auto places = Read("p.txt", "0 .333 .333 .333\n0 1.001 -.001 0\n", 2);
  ASSERT_THAT(places, IsOk());
  for (const double weight : places->points[0].weights) {
    EXPECT_DOUBLE_EQ(weight, 1.0 / 3);
  }
  EXPECT_THAT(places->points[1].weights, ElementsAre(1, 0, 0));
}

TEST_F(PlaceFileTest, MapsOfAnyFormatArePlacesToo) {
  const VertexMap map = {3, kNoVertex};
  for (const char* name : {"m.txt", "m.npy", "m.json"}) {
    const auto places = Read(name, FormatMap(map, 4, MapFormatOf(name)), 2);
    ASSERT_THAT(places, IsOk()) << name;
    EXPECT_FALSE(places->is_precise);
    EXPECT_EQ(places->points[0].vertices[0], 3);
    EXPECT_THAT(places->points[0].weights, ElementsAre(1, 0, 0));
    EXPECT_EQ(places->points[1].vertices[0], kNoVertex);
  }
}

TEST_F(PlaceFileTest, WrongPlacesNameTheLine) {
  ExpectRefused("0 1 0 0\n4 1 0 0\n", "line 2: FACE is 4, expected -1 to 3");
  ExpectRefused("0 1 0 0\n0 1 0\n", "line 2: found 3 numbers, expected 4");
  ExpectRefused("0 1 0 0\n0 1 x 0\n", "line 2: W1 is x, expected 0 to 1");
  ExpectRefused("0 1 0 0\n0 2 -1 0\n", "line 2: W0 is 2, expected 0 to 1");
  ExpectRefused("0 1 0 0\n0 0.5 0 0\n", "line 2: the sum of the weights");
  ExpectRefused("0 1 0 0\n", "1 lines, expected 2");
  ExpectRefused("0\n1\n2\n", "3 entries, expected 2");
  EXPECT_THAT(ReadPlaces(folder_.Path("none"), 2, mesh_),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("no such file")));
}

TEST_F(PlaceFileTest, NamedVerticesComeBack) {
  const auto read = [&](const std::string& text) {
    return ReadNamedVertices(folder_.Write("v.txt", text), mesh_);
  };
  const auto vertices = read("# points\n3 left ear # top\n\n 0\n");
  ASSERT_THAT(vertices, IsOk());
  EXPECT_EQ(FormatNamedVertices(*vertices), "3 left ear\n0\n");
  EXPECT_THAT(read("1\n4 tail\n"),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("line 2: VERTEX is 4, expected 0 to 3")));
  EXPECT_THAT(read("tail\n"), StatusIs(absl::StatusCode::kInvalidArgument,
                                       HasSubstr("VERTEX is tail")));
  EXPECT_THAT(read("# none\n"), StatusIs(absl::StatusCode::kInvalidArgument,
                                         HasSubstr("no line of numbers")));
}

TEST_F(PlaceFileTest, NamedVerticesAreOnTheSurface) {
  TriangleMesh mesh = mesh_;
  mesh.positions.conservativeResize(5, Eigen::NoChange);
  mesh.positions.row(4).setZero();
  EXPECT_THAT(ReadNamedVertices(folder_.Write("v.txt", "4\n"), mesh),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("VERTEX 4 is on no face")));
}

}  // namespace
}  // namespace isomatch
