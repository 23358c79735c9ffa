#include "core/mesh/surface_point.h"

#include <vector>

#include <gtest/gtest.h>

#include "core/base/random_stream.h"
#include "core/mesh/vertex_stars.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

std::vector<VertexIndex> AllFaces(const TriangleMesh& mesh) {
  std::vector<VertexIndex> faces;
  for (VertexIndex f = 0; f < mesh.num_faces(); ++f) faces.push_back(f);
  return faces;
}

TEST(SurfacePointTest, NoSampledPointOfTheFacesIsNearer) {
  const TriangleMesh mesh = BumpySphere(1);
  const std::vector<VertexIndex> faces = AllFaces(mesh);
  RandomStream random(1, 2);
  for (int trial = 0; trial < 50; ++trial) {
    const Eigen::RowVector3d position(3 * random.Unit() - 1.5,
                                      3 * random.Unit() - 1.5,
                                      3 * random.Unit() - 1.5);
    const SurfacePoint nearest = NearestOnFaces(mesh, faces, position);
    EXPECT_NEAR(nearest.weights.sum(), 1, 1e-12);
    EXPECT_GE(nearest.weights.minCoeff(), 0);
    const double distance = (PositionOf(mesh, nearest) - position).norm();
    for (const VertexIndex face : faces) {
      for (int sample = 0; sample < 10; ++sample) {
        double b = random.Unit();
        double c = random.Unit();
        if (b + c > 1) {
          b = 1 - b;
          c = 1 - c;
        }
        const SurfacePoint other = {face, {1 - b - c, b, c}};
        EXPECT_GE((PositionOf(mesh, other) - position).norm(),
                  distance - 1e-12);
      }
    }
  }
}

TEST(SurfacePointTest, APointOnTheSurfaceIsItsOwnNearest) {
  const TriangleMesh mesh = FiveArms(2);
  const SurfacePoint point = {17, {0.2, 0.5, 0.3}};
  const SurfacePoint found =
      NearestOnFaces(mesh, AllFaces(mesh), PositionOf(mesh, point));
  EXPECT_EQ(found.face, 17);
  EXPECT_LT((found.weights - point.weights).norm(), 1e-9);
}

TEST(SurfacePointTest, DegenerateFacesCountAsTheirEdges) {
  TriangleMesh mesh;
  mesh.positions.resize(3, 3);
  mesh.positions << 0, 0, 0, 1, 0, 0, 2, 0, 0;
  mesh.faces.resize(1, 3);
  mesh.faces << 0, 1, 2;
  const SurfacePoint found = NearestOnFaces(mesh, {0}, {1.5, 1, 0});
  EXPECT_LT((PositionOf(mesh, found) - Eigen::RowVector3d(1.5, 0, 0)).norm(),
            1e-12);
}

TEST(VertexStarsTest, AgreesWithASearchThroughAllFaces) {
  const TriangleMesh mesh = BumpySphere(1);
  const VertexStars stars(mesh);
  for (VertexIndex v = 0; v < mesh.num_vertices(); ++v) {
    std::vector<VertexIndex> faces;
    std::vector<VertexIndex> neighbors;
    for (VertexIndex other = 0; other < mesh.num_vertices(); ++other) {
      bool shares = false;
      for (VertexIndex f = 0; f < mesh.num_faces(); ++f) {
        const bool has_v = (mesh.faces.row(f).array() == v).any();
        shares =
            shares || (has_v && (mesh.faces.row(f).array() == other).any());
        if (other == v && has_v) faces.push_back(f);
      }
      if (shares && other != v) neighbors.push_back(other);
    }
    EXPECT_EQ(
        std::vector<VertexIndex>(stars.Faces(v).begin(), stars.Faces(v).end()),
        faces);
    EXPECT_EQ(std::vector<VertexIndex>(stars.Neighbors(v).begin(),
                                       stars.Neighbors(v).end()),
              neighbors);
  }
}

TEST(VertexStarsTest, AVertexOnNoFaceHasNone) {
  TriangleMesh mesh = Tetrahedron();
  mesh.positions.conservativeResize(5, 3);
  mesh.positions.row(4).setZero();
  EXPECT_TRUE(VertexStars(mesh).Faces(4).empty());
  EXPECT_TRUE(VertexStars(mesh).Neighbors(4).empty());
}

TEST(NearestOnFacesTest, InAnotherSpaceIsTheSameAsInThisOne) {
  // Positions turned into 5 dimensions: distances stay.
  const TriangleMesh mesh = FiveArms(2);
  Eigen::Matrix<float, 5, 3> turn = Eigen::Matrix<float, 5, 3>::Zero();
  turn.col(0) << 0.6f, 0.8f, 0, 0, 0;
  turn.col(1) << 0, 0, 0, 1, 0;
  turn.col(2) << 0.8f, -0.6f, 0, 0, 0;
  const PointColumns columns = turn * mesh.positions.transpose().cast<float>();
  const VertexStars stars(mesh);
  for (VertexIndex v = 0; v < mesh.num_vertices(); ++v) {
    const Eigen::RowVector3d wanted =
        1.02 * mesh.positions.row(v) +
        0.3 * (mesh.positions.row(stars.Neighbors(v).front()) -
               mesh.positions.row(v));
    const SurfacePoint in_space = NearestOnFaces(mesh, stars.Faces(v), wanted);
    const SurfacePoint turned =
        NearestOnFaces(mesh.faces, stars.Faces(v), columns,
                       turn * wanted.transpose().cast<float>());
    EXPECT_LT((PositionOf(mesh, in_space) - PositionOf(mesh, turned)).norm(),
              1e-3);
    EXPECT_GE(turned.weights.minCoeff(), 0);
    EXPECT_NEAR(turned.weights.sum(), 1, 1e-9);
  }
}

}  // namespace
}  // namespace isomatch
