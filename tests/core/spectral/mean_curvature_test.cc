#include "core/spectral/mean_curvature.h"

#include <gtest/gtest.h>

#include "core/mesh/mesh_geometry.h"
#include "tests/support/matchers.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

Eigen::VectorXd CurvatureOf(const TriangleMesh& mesh, double radius) {
  return *SmoothedMeanCurvature(BuildCotanLaplacian(mesh), mesh.positions,
                                VertexNormals(mesh), radius);
}

TEST(MeanCurvatureTest, IsOneOverTheRadiusOnSpheresAndNegativeFromInside) {
  for (const double radius : {0.01, 1.0, 100.0}) {
    TriangleMesh sphere = UnitSphere(4);
    sphere.positions *= radius;
    const Eigen::VectorXd outside = CurvatureOf(sphere, 0.1 * radius);
    EXPECT_LT((outside.array() * radius - 1).abs().maxCoeff(), 0.03);
    sphere.faces.col(0).swap(sphere.faces.col(1));
    const Eigen::VectorXd inside = CurvatureOf(sphere, 0.1 * radius);
    EXPECT_LT((inside.array() * radius + 1).abs().maxCoeff(), 0.03);
  }
}

TEST(MeanCurvatureTest, VanishesInThePlaneAwayFromTheRim) {
  const TriangleMesh plane = PlaneGrid(20, 20, 1, 1);
  const Eigen::VectorXd curvature = CurvatureOf(plane, 0.01);
  EXPECT_NEAR(curvature[10 * 21 + 10], 0, 1e-9);
}

TEST(MeanCurvatureTest, DiffusionKeepsTheIntegralAndLevelsThePeaks) {
  const TriangleMesh mesh = FiveArms(3);
  const Eigen::VectorXd mass = BuildCotanLaplacian(mesh).mass;
  const Eigen::VectorXd sharp = CurvatureOf(mesh, 0.01);
  const Eigen::VectorXd smooth = CurvatureOf(mesh, 0.5);
  EXPECT_NEAR(mass.dot(sharp), mass.dot(smooth), 1e-6 * mass.dot(sharp));
  EXPECT_LT(smooth.maxCoeff(), sharp.maxCoeff());
}

}  // namespace
}  // namespace isomatch
