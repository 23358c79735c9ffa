#include "client/transfer/transfer.h"

#include <cstddef>
#include <numeric>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/matchers.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

using testing::ElementsAre;

PrecisePoint At(VertexIndex y) { return {{y, y, y}, {1, 0, 0}}; }

std::vector<PrecisePoint> AtAll(const VertexMap& map) {
  std::vector<PrecisePoint> places;
  for (const VertexIndex y : map) places.push_back(At(y));
  return places;
}

TEST(TransferTest, TheIdentityCarriesColorsUnchanged) {
  const TriangleMesh sphere = UnitSphere(2);
  const Colors colors = PositionColors(sphere);
  VertexMap identity(static_cast<std::size_t>(sphere.num_vertices()));
  std::iota(identity.begin(), identity.end(), 0);
  EXPECT_EQ(CarryColors(colors, AtAll(identity)), colors);
}

TEST(TransferTest, APermutationPermutes) {
  const VertexMap map = RandomPermutation(42, 3);
  std::vector<std::int64_t> labels(42);
  std::iota(labels.begin(), labels.end(), 100);
  const std::vector<std::int64_t> carried = CarryLabels(labels, AtAll(map), -1);
  const Colors colors_y = Colors::Random(42, 3);
  const Colors colors = CarryColors(colors_y, AtAll(map));
  for (std::size_t x = 0; x < map.size(); ++x) {
    EXPECT_EQ(carried[x], 100 + map[x]);
    EXPECT_EQ(colors.row(static_cast<Eigen::Index>(x)), colors_y.row(map[x]));
  }
}

TEST(TransferTest, ColorsAreInterpolatedAndLabelsAreNot) {
  Colors colors(3, 3);
  colors << 1, 0, 0, 0, 1, 0, 0, 0, 1;
  const std::vector<PrecisePoint> places = {
      {{0, 1, 2}, {0.25, 0.5, 0.25}}, {{0, 1, 2}, {0.5, 0, 0.5}}, {}};
  const Colors carried = CarryColors(colors, places);
  EXPECT_EQ(carried.row(0), Eigen::RowVector3d(0.25, 0.5, 0.25));
  EXPECT_EQ(carried.row(2), kNoColor);
  EXPECT_THAT(CarryLabels(std::vector<std::int64_t>{10, 20, 40}, places, -7),
              ElementsAre(20, 10, -7));
  EXPECT_EQ(CountUnmatched(places), 1);
}

class CarryLandmarksTest : public testing::Test {
 protected:
  std::vector<CarriedLandmark> Carry(const std::vector<VertexIndex>& landmarks,
                                     const TriangleMesh& x,
                                     const TriangleMesh& y,
                                     const std::vector<PrecisePoint>& places) {
    const auto carried = CarryLandmarks(landmarks, x, y, places, {});
    EXPECT_THAT(carried, IsOk());
    return *carried;
  }
};

TEST_F(CarryLandmarksTest, APermutationGivesTheInverse) {
  const TriangleMesh sphere = UnitSphere(2);
  const std::vector<VertexIndex> new_from_old =
      RandomPermutation(sphere.num_vertices(), 9);
  // X is the sphere with old vertex v called new_from_old[v].
  VertexMap map(new_from_old.size());
  for (std::size_t v = 0; v < map.size(); ++v) {
    map[static_cast<std::size_t>(new_from_old[v])] =
        static_cast<VertexIndex>(v);
  }
  for (const VertexIndex y : {0, 5, 100}) {
    const auto found =
        Carry({y}, Relabeled(sphere, new_from_old), sphere, AtAll(map)).at(0);
    EXPECT_EQ(found.x, new_from_old[static_cast<std::size_t>(y)]);
    EXPECT_EQ(found.distance, 0);
  }
}

TEST_F(CarryLandmarksTest, TheNearestPlaceAlongTheSurfaceWins) {
  // A strip from (0, 0) to (8, 1); X has three vertices on it.
  const TriangleMesh y = PlaneGrid(8, 1, 8, 1);
  const TriangleMesh x = PlaneGrid(2, 1, 8, 1);
  const auto found = Carry({5}, x, y, {At(0), At(4), At(8), {}, {}, {}}).at(0);
  EXPECT_EQ(found.x, 1);
  EXPECT_NEAR(found.distance, 1, 1e-6);
}

TEST_F(CarryLandmarksTest, WhereYLiesDoesNotMatter) {
  const TriangleMesh near = BumpySphere(3);
  TriangleMesh far = near;
  far.positions.rowwise() += Eigen::RowVector3d(500'000, 4'500'000, 120);
  VertexMap map(static_cast<std::size_t>(near.num_vertices()));
  std::iota(map.begin(), map.end(), 0);
  map[5] = 100;  // so that another is the nearest
  const auto here = Carry({5, 7}, near, near, AtAll(map));
  const auto there = Carry({5, 7}, near, far, AtAll(map));
  for (std::size_t i = 0; i < here.size(); ++i) {
    EXPECT_EQ(there[i].x, here[i].x);
    EXPECT_NEAR(there[i].distance, here[i].distance, 1e-5);
  }
}

TEST_F(CarryLandmarksTest, OfSeveralTheOneInTheirMiddleIsTaken) {
  const TriangleMesh y = PlaneGrid(2, 1, 2, 1);
  const TriangleMesh x = PlaneGrid(6, 1, 6, 1);
  // Vertices 1 to 5 of the lower row all go to vertex 1 of Y.
  std::vector<PrecisePoint> places(14);
  places[0] = At(0);
  for (std::size_t v = 1; v <= 5; ++v) places[v] = At(1);
  places[6] = At(2);
  EXPECT_EQ(Carry({1}, x, y, places).at(0).x, 3);
  // Two equally near to their middle: the first.
  places[5] = {};
  EXPECT_EQ(Carry({1}, x, y, places).at(0).x, 2);
}

TEST_F(CarryLandmarksTest, PrecisePlacesBreakTies) {
  const TriangleMesh y = PlaneGrid(2, 1, 2, 1);
  const TriangleMesh x = PlaneGrid(2, 1, 2, 1);
  std::vector<PrecisePoint> places(6);
  places[0] = {{0, 1, 4}, {0.4, 0.6, 0}};
  places[1] = {{0, 1, 4}, {0.1, 0.9, 0}};
  const auto found = Carry({1}, x, y, places).at(0);
  EXPECT_EQ(found.x, 1);
  EXPECT_NEAR(found.distance, 0.1, 1e-6);
}

TEST_F(CarryLandmarksTest, AVertexThatOnlyDamagedFacesUseIsOutOfReach) {
  const TriangleMesh plane = PlaneGrid(1, 1, 1, 1);
  TriangleMesh y = plane;
  y.positions.conservativeResize(5, Eigen::NoChange);
  y.positions.row(4) << 9, 9, 9;
  y.faces.conservativeResize(3, Eigen::NoChange);
  y.faces.row(2) << 0, 0, 4;
  const auto found = Carry({4, 1}, plane, y, AtAll({0, 1, 2, 3}));
  EXPECT_EQ(found.at(0).x, kNoVertex);
  EXPECT_EQ(found.at(1).x, 1);
}

TEST_F(CarryLandmarksTest, AnotherComponentIsOutOfReach) {
  const TriangleMesh plane = PlaneGrid(1, 1, 1, 1);
  TriangleMesh y;
  y.positions.resize(8, 3);
  y.positions << plane.positions,
      plane.positions.rowwise() + Eigen::RowVector3d(0, 0, 9);
  y.faces.resize(4, 3);
  y.faces << plane.faces, (plane.faces.array() + 4).matrix();
  const auto found = Carry({6}, plane, y, AtAll({0, 1, 2, 3})).at(0);
  EXPECT_EQ(found.x, kNoVertex);
}

}  // namespace
}  // namespace isomatch
