#include "core/spectral/spectral_basis.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

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

/// Identities that hold for every basis.
void ExpectEigenpairs(const CotanLaplacian& laplacian,
                      const SpectralBasis& basis) {
  const Eigen::MatrixXd& phi = basis.functions;
  const Eigen::MatrixXd gram =
      phi.transpose() * laplacian.mass.asDiagonal() * phi;
  EXPECT_LT((gram - Eigen::MatrixXd::Identity(gram.rows(), gram.cols())).norm(),
            1e-6);
  const Eigen::MatrixXd residual =
      laplacian.stiffness * phi -
      laplacian.mass.asDiagonal() * phi * basis.eigenvalues.asDiagonal();
  EXPECT_LT(residual.norm(), 1e-4 * (laplacian.stiffness * phi).norm());
}

TEST(SpectralBasisTest, FunctionsAreOrthonormalEigenfunctions) {
  for (const int levels : {2, 4}) {  // dense and Lanczos
    const CotanLaplacian laplacian = BuildCotanLaplacian(FiveArms(levels));
    const auto basis = ComputeSpectralBasis(laplacian, 40, {});
    ASSERT_THAT(basis, IsOk());
    EXPECT_EQ(basis->size(), 40);
    ExpectEigenpairs(laplacian, *basis);
  }
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
