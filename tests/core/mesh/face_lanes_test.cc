#include "core/mesh/face_lanes.h"

#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include <gtest/gtest.h>

#include "core/base/random_stream.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

/// A vertex in the middle of `count` faces, higher than the rim.
TriangleMesh Cone(int count) {
  TriangleMesh cone;
  cone.positions.resize(count + 1, 3);
  cone.faces.resize(count, 3);
  cone.positions.row(0) << 0, 0, 0.3;
  for (int i = 0; i < count; ++i) {
    const double angle = 2 * std::numbers::pi * i / count;
    cone.positions.row(i + 1) << std::cos(angle), std::sin(angle), 0;
    // Each face begins at another corner.
    const int corners[3] = {0, i + 1, (i + 1) % count + 1};
    for (int k = 0; k < 3; ++k) cone.faces(i, k) = corners[(i + k) % 3];
  }
  return cone;
}

void ExpectNearestAround(const TriangleMesh& mesh, double spread) {
  const VertexStars stars(mesh);
  const std::vector<FaceLanes> around = FacesAroundVertices(mesh, stars);
  RandomStream random(3, 5);
  for (VertexIndex v = 0; v < mesh.num_vertices(); ++v) {
    Eigen::RowVector3d offset;
    for (double& value : offset) value = spread * (random.Unit() - 0.5);
    const Eigen::RowVector3d position = mesh.positions.row(v) + offset;
    const SurfacePoint found = around[v].Nearest(position);
    const SurfacePoint wanted = NearestOnFaces(mesh, stars.Faces(v), position);
    EXPECT_NEAR((PositionOf(mesh, found) - position).norm(),
                (PositionOf(mesh, wanted) - position).norm(), 1e-6)
        << v;
    EXPECT_NEAR(found.weights.sum(), 1, 1e-6);
    EXPECT_GE(found.weights.minCoeff(), 0);
  }
}

TEST(FaceLanesTest, AgreeWithOneFaceAfterTheOther) {
  for (const double spread : {1e-3, 0.1, 3.0}) {
    ExpectNearestAround(FiveArms(3), spread);
    ExpectNearestAround(BumpySphere(2), spread);
    // Groups of one, two and five.
    for (const int count : {3, 8, 9, 40}) {
      ExpectNearestAround(Cone(count), spread);
    }
  }
}

TEST(FaceLanesTest, FacesNeedNotMeetAtTheVertex) {
  const TriangleMesh mesh = BumpySphere(1);
  std::vector<VertexIndex> all;
  for (VertexIndex f = 0; f < mesh.num_faces(); ++f) all.push_back(f);
  const FaceLanes lanes(mesh, all, 5);
  RandomStream random(1, 2);
  for (int trial = 0; trial < 200; ++trial) {
    const Eigen::RowVector3d position(3 * random.Unit() - 1.5,
                                      3 * random.Unit() - 1.5,
                                      3 * random.Unit() - 1.5);
    const auto distance = [&](const SurfacePoint& point) {
      return (PositionOf(mesh, point) - position).norm();
    };
    EXPECT_NEAR(distance(lanes.Nearest(position)),
                distance(NearestOnFaces(mesh, all, position)), 1e-5);
  }
}

TEST(FaceLanesTest, SliversAndFacesWithoutAreaCountAsTheirSides) {
  TriangleMesh thread = FiveArms(2);
  thread.positions.col(2) *= 1e-7;
  thread.positions.col(1) *= 1e-4;
  ExpectNearestAround(thread, 0.1);
  TriangleMesh line;
  line.positions.resize(3, 3);
  line.positions << 0, 0, 0, 1, 0, 0, 2, 0, 0;
  line.faces.resize(1, 3);
  line.faces << 0, 1, 2;
  ExpectNearestAround(line, 3);
}

TEST(FaceLanesTest, ALongFaceBesideTheVertexIsNoNearerThanItLies) {
  // A needle whose first corner is far away passes by the vertex.
  TriangleMesh mesh;
  mesh.positions.resize(4, 3);
  mesh.positions << 0, 0, 0, 1000, 0.2, 0, 0.1, 0.2, 0, 0.1, 0.3, 0;
  mesh.faces.resize(1, 3);
  mesh.faces << 1, 3, 2;
  const Eigen::RowVector3d position(0.05, 0.1, 0.02);
  const SurfacePoint found = FaceLanes(mesh, {0}, 0).Nearest(position);
  EXPECT_LT((PositionOf(mesh, found) - mesh.positions.row(2)).norm(), 1e-4);
}

TEST(FaceLanesTest, ThereIsAPointWhateverThePosition) {
  const TriangleMesh mesh = BumpySphere(1);
  const FaceLanes around = FacesAroundVertices(mesh, VertexStars(mesh))[7];
  for (const double far :
       {1e30, -1e300, std::numeric_limits<double>::quiet_NaN()}) {
    const SurfacePoint found = around.Nearest({far, 0, 0});
    ASSERT_GE(found.face, 0);
    EXPECT_NEAR(found.weights.sum(), 1, 1e-6);
  }
}

TEST(FaceLanesTest, AVertexIsItsOwnNearest) {
  const TriangleMesh mesh = FiveArms(2);
  const VertexStars stars(mesh);
  const std::vector<FaceLanes> around = FacesAroundVertices(mesh, stars);
  for (VertexIndex v = 0; v < mesh.num_vertices(); ++v) {
    EXPECT_EQ(PositionOf(mesh, around[v].Nearest(mesh.positions.row(v))),
              mesh.positions.row(v));
  }
}

}  // namespace
}  // namespace isomatch
