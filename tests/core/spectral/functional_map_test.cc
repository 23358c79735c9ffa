#include "core/spectral/functional_map.h"

#include <numeric>

#include <gtest/gtest.h>

#include "tests/support/matchers.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

SpectralBasis BasisOf(const TriangleMesh& mesh, int count) {
  return *ComputeSpectralBasis(BuildCotanLaplacian(mesh), count, {});
}

VertexMap Identity(const TriangleMesh& mesh) {
  VertexMap identity(mesh.num_vertices());
  std::iota(identity.begin(), identity.end(), 0);
  return identity;
}

TEST(FunctionalMapTest, OfTheIdentityIsTheIdentity) {
  const SpectralBasis basis = BasisOf(FiveArms(3), 20);
  const Eigen::MatrixXd fmap =
      FunctionalMapFromVertexMap(basis, basis, Identity(FiveArms(3)), 20);
  EXPECT_LT((fmap - Eigen::MatrixXd::Identity(20, 20)).norm(), 1e-6);
}

TEST(FunctionalMapTest, FollowsARotationOfTheBasis) {
  const SpectralBasis basis_x = BasisOf(FiveArms(3), 3);
  SpectralBasis basis_y = basis_x;
  // Psi = Phi R: pulling psi_j back gives sum_i phi_i R_ij, so C is R, and not
  // its transpose.
  Eigen::Matrix3d rotation;
  rotation << 1, 0, 0, 0, 0.6, -0.8, 0, 0.8, 0.6;
  basis_y.functions = basis_x.functions * rotation;
  const VertexMap identity = Identity(FiveArms(3));
  const Eigen::MatrixXd fmap =
      FunctionalMapFromVertexMap(basis_x, basis_y, identity, 3);
  EXPECT_LT((fmap - rotation).norm(), 1e-6);
  const auto map =
      NearestColumns(FunctionColumns(basis_x, static_cast<int>(fmap.rows())),
                     CarriedColumns(basis_y, fmap), {});
  ASSERT_THAT(map, IsOk());
  int right = 0;
  for (std::size_t v = 0; v < map->size(); ++v)
    right += (*map)[v] == identity[v];
  EXPECT_GT(right, 0.95 * identity.size());
}

TEST(FunctionalMapTest, PartOfTheVerticesDeterminesIt) {
  const SpectralBasis basis = BasisOf(FiveArms(3), 10);
  VertexMap partial(FiveArms(3).num_vertices(), kNoVertex);
  for (std::size_t v = 0; v < partial.size(); v += 7) {
    partial[v] = static_cast<VertexIndex>(v);
  }
  const Eigen::MatrixXd fmap =
      FunctionalMapFromVertexMap(basis, basis, partial, 10);
  EXPECT_LT((fmap - Eigen::MatrixXd::Identity(10, 10)).norm(), 1e-3);
}

TEST(DenseFunctionalMapTest, IsThatOfTheMapInSinglePrecision) {
  // More vertices than go into one block.
  const TriangleMesh mesh = FiveArms(4);
  const VertexIndex n = mesh.num_vertices();
  const SpectralBasis basis = BasisOf(mesh, 25);
  const PointColumns columns = FunctionColumns(basis, 20);
  VertexMap map;
  for (VertexIndex v = 0; v < n; ++v) map.push_back((v * 7 + 3) % n);
  const Eigen::MatrixXf fmap =
      DenseFunctionalMap(columns, basis.mass, columns, map);
  const Eigen::MatrixXd expected =
      FunctionalMapFromVertexMap(basis, basis, map, 20);
  EXPECT_LT((fmap.cast<double>() - expected).cwiseAbs().maxCoeff(), 1e-4);
  PointColumns carried(20, n);
  CarryOver(fmap, columns, carried);
  const Eigen::MatrixXd carried_slowly =
      expected * basis.functions.leftCols(20).transpose();
  EXPECT_LT((carried.cast<double>() - carried_slowly).cwiseAbs().maxCoeff(),
            1e-3 * carried_slowly.cwiseAbs().maxCoeff());
}

TEST(FunctionalMapTest, RelabelingIsUndoneByTheVertexMap) {
  const TriangleMesh mesh = FiveArms(3);
  const auto permutation = RandomPermutation(mesh.num_vertices(), /*seed=*/4);
  const SpectralBasis basis_x = BasisOf(mesh, 30);
  const SpectralBasis basis_y = BasisOf(Relabeled(mesh, permutation), 30);
  const Eigen::MatrixXd fmap =
      FunctionalMapFromVertexMap(basis_x, basis_y, permutation, 30);
  EXPECT_LT(
      (fmap * fmap.transpose() - Eigen::MatrixXd::Identity(30, 30)).norm(),
      1e-5);
  const auto map =
      NearestColumns(FunctionColumns(basis_x, static_cast<int>(fmap.rows())),
                     CarriedColumns(basis_y, fmap), {});
  ASSERT_THAT(map, IsOk());
  EXPECT_EQ(*map, permutation);
}

}  // namespace
}  // namespace isomatch
