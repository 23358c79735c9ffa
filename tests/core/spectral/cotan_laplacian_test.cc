#include "core/spectral/cotan_laplacian.h"

#include <gtest/gtest.h>

#include "core/mesh/mesh_geometry.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

using Matrix = Eigen::SparseMatrix<double>;

TEST(CotanLaplacianTest, AnnihilatesConstantsAndIsSymmetric) {
  for (const TriangleMesh& mesh :
       {Tetrahedron(), PlaneGrid(9, 7, 3, 1), FiveArms(3)}) {
    const Matrix stiffness = BuildCotanLaplacian(mesh).stiffness;
    const Eigen::VectorXd ones = Eigen::VectorXd::Ones(mesh.num_vertices());
    EXPECT_LT((stiffness * ones).cwiseAbs().maxCoeff(), 1e-9);
    EXPECT_LT((stiffness - Matrix(stiffness.transpose())).norm(), 1e-9);
  }
}

TEST(CotanLaplacianTest, MassSumsToTheArea) {
  for (const double scale : {1e-8, 1.0, 1e8}) {
    const TriangleMesh mesh = Moved(FiveArms(3), scale);
    EXPECT_NEAR(BuildCotanLaplacian(mesh).mass.sum() / SurfaceArea(mesh), 1,
                1e-3);
  }
}

TEST(CotanLaplacianTest, LinearFunctionsAreHarmonicInThePlane) {
  const int columns = 8;
  const TriangleMesh plane = PlaneGrid(columns, 6, 2, 1);
  const Eigen::VectorXd values =
      BuildCotanLaplacian(plane).stiffness *
      (2 * plane.positions.col(0) - 3 * plane.positions.col(1));
  for (int row = 1; row < 6; ++row) {
    for (int column = 1; column < columns; ++column) {
      EXPECT_NEAR(values[row * (columns + 1) + column], 0, 1e-9);
    }
  }
}

TEST(CotanLaplacianTest, EnergyOfALinearFunctionIsItsGradientTimesTheArea) {
  const TriangleMesh plane = PlaneGrid(8, 6, 2, 1);
  const Eigen::VectorXd f = 2 * plane.positions.col(0);
  // |grad f|^2 area = 4 * 2, positive: L is the positive semi-definite one.
  EXPECT_NEAR(f.dot(BuildCotanLaplacian(plane).stiffness * f), 8, 1e-2);
}

TEST(CotanLaplacianTest, SliversKeepEverythingFinite) {
  TriangleMesh mesh = PlaneGrid(4, 4, 1, 1);
  mesh.positions.row(7) = mesh.positions.row(6);
  mesh.positions(7, 0) += 1e-13;
  const CotanLaplacian laplacian = BuildCotanLaplacian(mesh);
  EXPECT_TRUE(Eigen::MatrixXd(laplacian.stiffness).allFinite());
  EXPECT_GT(laplacian.mass.minCoeff(), 0);
  Eigen::VectorXd f = Eigen::VectorXd::Random(mesh.num_vertices());
  EXPECT_GE(f.dot(laplacian.stiffness * f), 0);
}

}  // namespace
}  // namespace isomatch
