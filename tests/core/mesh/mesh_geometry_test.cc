#include "core/mesh/mesh_geometry.h"

#include <cmath>
#include <numbers>
#include <optional>

#include <gtest/gtest.h>

#include "tests/support/shapes.h"

namespace isomatch {
namespace {

TEST(SurfaceAreaTest, IsThatOfTheRectangle) {
  EXPECT_NEAR(SurfaceArea(PlaneGrid(7, 3, 2.0, 1.5)), 3.0, 1e-12);
}

TEST(SurfaceAreaTest, ConvergesToTheSphereAtSecondOrder) {
  double error[2];
  for (int i = 0; i < 2; ++i) {
    error[i] = 4 * std::numbers::pi - SurfaceArea(UnitSphere(3 + i));
  }
  EXPECT_GT(error[1], 0);
  // Halved edges: a quarter of the error.
  EXPECT_NEAR(error[0] / error[1], 4, 0.1);
}

TEST(VertexNormalsTest, PointOutwardsOnTheSphere) {
  const TriangleMesh sphere = UnitSphere(3);
  const Positions normals = VertexNormals(sphere);
  for (VertexIndex v = 0; v < sphere.num_vertices(); ++v) {
    EXPECT_GT(normals.row(v).dot(sphere.positions.row(v)), 0.999);
  }
}

TEST(SignedVolume6Test, SumsToSixTimesTheVolumeWhateverTheOrigin) {
  const TriangleMesh box = Tetrahedron();
  double volume[2] = {0, 0};
  for (VertexIndex f = 0; f < box.num_faces(); ++f) {
    volume[0] += SignedVolume6(box, f, {0, 0, 0});
    volume[1] += SignedVolume6(box, f, {3, -1, 2});
  }
  // det of the three edges from the first corner.
  EXPECT_NEAR(volume[0], 1.3 * 1.7, 1e-12);
  EXPECT_NEAR(volume[1], volume[0], 1e-12);
}

TEST(MeanEdgeLengthTest, CountsTheEdgesOfEachFace) {
  const double diagonal = std::sqrt(2.0);
  EXPECT_NEAR(MeanEdgeLength(PlaneGrid(4, 4, 4, 4)), (2 + diagonal) / 3, 1e-12);
}

TEST(BoxOfFacesTest, LeavesVerticesOnNoFaceOut) {
  TriangleMesh grid = PlaneGrid(2, 3, 2, 3);
  grid.positions.conservativeResize(grid.num_vertices() + 1, Eigen::NoChange);
  grid.positions.bottomRows(1) << 9, -9, 9;
  const Eigen::AlignedBox3d box = BoxOfFaces(grid);
  EXPECT_EQ(box.min(), Eigen::Vector3d(0, 0, 0));
  EXPECT_EQ(box.max(), Eigen::Vector3d(2, 3, 0));
}

TEST(CoarseRoundingTest, IsToldFromAHundredthOfTheMeanEdgeOn) {
  const double edge = MeanEdgeLength(PlaneGrid(4, 4, 4, 4));
  // Coordinates of this size are rounded by so much.
  const double far = 0.01 * edge * std::ldexp(1.0, 24);
  for (const double sign : {-1.0, 1.0}) {
    TriangleMesh grid = PlaneGrid(4, 4, 4, 4);
    grid.positions.col(1).array() += sign * 0.999 * far;
    EXPECT_FALSE(CoarseRounding(grid));
    grid.positions.col(1).array() += sign * 0.002 * far;
    const std::optional<SingleRounding> rounding = CoarseRounding(grid);
    ASSERT_TRUE(rounding);
    EXPECT_NEAR(rounding->farthest, 1.001 * far, 4.001);
    EXPECT_NEAR(rounding->most, 0.01 * edge, 0.0001 * edge);
    EXPECT_NEAR(rounding->mean_edge, edge, 1e-9 * far);
  }
}

}  // namespace
}  // namespace isomatch
