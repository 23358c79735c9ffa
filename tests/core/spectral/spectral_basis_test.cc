#include "core/spectral/spectral_basis.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include <gtest/gtest.h>
#include <Eigen/SparseCholesky>

#include "core/spectral/filtered_subspace.h"
#include "tests/support/matchers.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

TEST(SpectralBasisTest, SphereHasEigenvaluesOfSphericalHarmonics) {
  // Of degree l, l (l + 1), 2 l + 1 times; the relative error is second order
  // in the edge length and grows with the eigenvalue.
  double worst[2] = {0, 0};
  for (const int finer : {0, 1}) {
    const auto basis = ComputeSpectralBasis(
        BuildCotanLaplacian(UnitSphere(3 + finer)), 36, {});
    ASSERT_THAT(basis, IsOk());
    EXPECT_NEAR(basis->eigenvalues[0], 0, 1e-6);
    int index = 1;
    for (int l = 1; l < 6; ++l) {
      for (int m = -l; m <= l; ++m, ++index) {
        worst[finer] =
            std::max(worst[finer],
                     std::abs(basis->eigenvalues[index] / (l * (l + 1)) - 1));
      }
    }
  }
  EXPECT_LT(worst[1], 0.02);
  EXPECT_NEAR(worst[0] / worst[1], 4, 1);
}

TEST(SpectralBasisTest, RectangleHasTheCosineEigenvalues) {
  const auto basis =
      ComputeSpectralBasis(BuildCotanLaplacian(PlaneGrid(60, 30, 2, 1)), 4, {});
  ASSERT_THAT(basis, IsOk());
  const double unit = std::numbers::pi * std::numbers::pi;
  // (i / 2)^2 + j^2, without flow over the rim.
  const double expected[] = {0, unit / 4, unit, unit};
  for (int i = 0; i < 4; ++i) {
    EXPECT_NEAR(basis->eigenvalues[i], expected[i], 0.01 * unit);
  }
}

void ExpectOrthonormal(const SpectralBasis& basis) {
  const Eigen::MatrixXd gram =
      basis.functions.transpose() * basis.mass.asDiagonal() * basis.functions;
  EXPECT_LT((gram - Eigen::MatrixXd::Identity(gram.rows(), gram.cols())).norm(),
            1e-6);
}

/// Identities that hold for every basis.
void ExpectEigenpairs(const CotanLaplacian& laplacian,
                      const SpectralBasis& basis) {
  ExpectOrthonormal(basis);
  const Eigen::MatrixXd& phi = basis.functions;
  const Eigen::MatrixXd residual =
      laplacian.stiffness * phi -
      laplacian.mass.asDiagonal() * phi * basis.eigenvalues.asDiagonal();
  EXPECT_LT(residual.norm(), 1e-4 * (laplacian.stiffness * phi).norm());
}

TEST(SpectralBasisTest, FunctionsAreOrthonormalEigenfunctions) {
  for (const int levels : {2, 4}) {  // dense, and by blocks
    const CotanLaplacian laplacian = BuildCotanLaplacian(FiveArms(levels));
    const auto basis = ComputeSpectralBasis(laplacian, 40, {});
    ASSERT_THAT(basis, IsOk());
    EXPECT_EQ(basis->size(), 40);
    ExpectEigenpairs(laplacian, *basis);
  }
}

/// Teeth of one length side by side on a bar that is wide beside them.
TriangleMesh Comb(int teeth) {
  TriangleMesh mesh = PlaneGrid(2 * teeth - 1, 2, 1, 1);
  const VertexIndex columns = 2 * teeth;
  mesh.positions.col(0) *= .1 * columns;
  mesh.positions.col(1).segment(columns, columns).setConstant(1000);
  mesh.positions.col(1).tail(columns).setConstant(1010);
  std::vector<VertexIndex> kept;
  for (VertexIndex f = 0; f < mesh.num_faces(); ++f) {
    const VertexIndex left = mesh.faces.row(f).minCoeff();
    if (left < columns || left % 2 == 0) kept.push_back(f);
  }
  mesh.faces = mesh.faces(kept, Eigen::all).eval();
  return mesh;
}

/// Eigenvalues below `value`, as many as negative pivots (Sylvester).
Eigen::Index NumBelow(double value, const CotanLaplacian& laplacian) {
  Eigen::SparseMatrix<double> shifted = laplacian.stiffness;
  shifted.diagonal() -= value * laplacian.mass;
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factor(shifted);
  return (factor.vectorD().array() < 0).count();
}

TEST(SpectralBasisTest, NoneIsMissingWhereEigenvaluesAccumulate) {
  // Just below that of a tooth held at its root, ever closer; Lanczos, told to
  // tell them apart down to 1e-10, takes 45 restarts.
  const CotanLaplacian laplacian = BuildCotanLaplacian(Comb(1000));
  EXPECT_THAT(
      FilteredSubspace(NormalizedStiffness(laplacian), laplacian.mass, 128, {})
          .status(),
      StatusIs(absl::StatusCode::kInternal,
               testing::HasSubstr("subspace iteration")));
  const auto basis = ComputeSpectralBasis(laplacian, 128, {});
  ASSERT_THAT(basis, IsOk());
  const Eigen::VectorXd& values = basis->eigenvalues;
  EXPECT_LT(values[127] / values[60] - 1, 1e-3);
  for (int k = 1; k < 128; ++k) {
    EXPECT_LE(NumBelow((1 - 1e-8) * values[k], laplacian), k);
    EXPECT_GT(NumBelow((1 + 1e-8) * values[k], laplacian), k);
    const auto phi = basis->functions.col(k);
    EXPECT_NEAR(phi.dot(laplacian.stiffness * phi) / values[k], 1, 1e-6);
  }
  ExpectOrthonormal(*basis);
}

TEST(SpectralBasisTest, ASmallMeshGivesAllItHas) {
  const auto basis =
      ComputeSpectralBasis(BuildCotanLaplacian(Tetrahedron()), 100, {});
  ASSERT_THAT(basis, IsOk());
  EXPECT_EQ(basis->size(), 4);
}

TEST(SpectralBasisTest, StopsWhenAsked) {
  std::stop_source stop;
  stop.request_stop();
  EXPECT_THAT(ComputeSpectralBasis(BuildCotanLaplacian(FiveArms(3)), 20,
                                   stop.get_token())
                  .status(),
              StatusIs(absl::StatusCode::kCancelled, testing::_));
}

}  // namespace
}  // namespace isomatch
