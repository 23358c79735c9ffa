#include "core/spectral/filtered_subspace.h"

#include <gtest/gtest.h>
#include <Eigen/Eigenvalues>

#include "core/base/parallel.h"
#include "core/spectral/cotan_laplacian.h"
#include "tests/support/dirty_meshes.h"
#include "tests/support/matchers.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

/// M^-1/2 L M^-1/2 and M.
struct Problem {
  explicit Problem(const TriangleMesh& mesh) {
    const CotanLaplacian laplacian = BuildCotanLaplacian(mesh);
    matrix = NormalizedStiffness(laplacian);
    mass = laplacian.mass;
  }

  Eigen::SparseMatrix<double> matrix;
  Eigen::VectorXd mass;
};

/// Compares with all eigenvalues of the dense matrix.
void ExpectLowest(const TriangleMesh& mesh, int count) {
  const Problem problem(mesh);
  const auto pairs = FilteredSubspace(problem.matrix, problem.mass, count, {});
  ASSERT_THAT(pairs, IsOk());
  ASSERT_EQ(pairs->values.size(), count);
  const Eigen::VectorXd expected =
      Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(
          Eigen::MatrixXd(problem.matrix), Eigen::EigenvaluesOnly)
          .eigenvalues();
  const double largest = expected[count - 1];
  EXPECT_LT((pairs->values - expected.head(count)).cwiseAbs().maxCoeff(),
            1e-4 * largest);
  const Eigen::MatrixXd& vectors = pairs->vectors;
  EXPECT_LT(
      (vectors.transpose() * vectors - Eigen::MatrixXd::Identity(count, count))
          .norm(),
      1e-9);
  const Eigen::MatrixXd off =
      problem.matrix * vectors - vectors * pairs->values.asDiagonal();
  EXPECT_LT(off.colwise().norm().maxCoeff(), 0.01 * largest);
  EXPECT_LE(pairs->residual, 0.01);
}

TEST(FilteredSubspaceTest, FindsWhatADenseSolverFinds) {
  ExpectLowest(FiveArms(3), 60);
}

TEST(FilteredSubspaceTest, FindsAllCopiesOfRepeatedValues) {
  ExpectLowest(UnitSphere(3), 100);
}

TEST(FilteredSubspaceTest, OfOpenSurfacesToo) {
  ExpectLowest(PlaneGrid(30, 20, 3, 2), 64);
}

TEST(FilteredSubspaceTest, FindsPiecesThatNoFirstVectorIsOn) {
  // Each a thousandth of the area, of which every first vector has a 96th; more
  // of them than a panel has vectors.
  constexpr int kPieces = 40;
  DirtyMesh pieces = Untouched(FiveArms(3));
  for (int i = 0; i < kPieces; ++i) {
    const VertexIndex before = pieces.mesh.num_vertices();
    pieces = Joined(pieces, Untouched(Moved(BumpySphere(1), 0.02)), before);
  }
  const Problem problem(pieces.mesh);
  const auto pairs = FilteredSubspace(problem.matrix, problem.mass, 60, {});
  ASSERT_THAT(pairs, IsOk());
  EXPECT_LT(pairs->values.head(kPieces + 1).cwiseAbs().maxCoeff(), 1e-4);
  EXPECT_GT(pairs->values[kPieces + 1], 0.1);
}

TEST(FilteredSubspaceTest, DoesNotDependOnTheUnit) {
  constexpr double kUnit = 1e6;
  const Problem meters(FiveArms(3));
  const TriangleMesh mesh = FiveArms(3);
  const Problem micrometers(TriangleMesh{kUnit * mesh.positions, mesh.faces});
  const auto expected = FilteredSubspace(meters.matrix, meters.mass, 60, {});
  const auto found =
      FilteredSubspace(micrometers.matrix, micrometers.mass, 60, {});
  ASSERT_THAT(expected, IsOk());
  ASSERT_THAT(found, IsOk());
  EXPECT_LT((kUnit * kUnit * found->values - expected->values).norm(),
            1e-6 * expected->values.norm());
}

TEST(FilteredSubspaceTest, TheSameBytesAtAnyThreadCount) {
  const Problem problem(FiveArms(3));
  LowestPairs found[2];
  for (const int i : {0, 1}) {
    RunWithThreads(i == 0 ? 1 : 4, [&] {
      const auto pairs = FilteredSubspace(problem.matrix, problem.mass, 60, {});
      ASSERT_THAT(pairs, IsOk());
      found[i] = *pairs;
    });
  }
  EXPECT_EQ(found[0].values, found[1].values);
  EXPECT_EQ(found[0].vectors, found[1].vectors);
}

TEST(FilteredSubspaceTest, StopsWhenAsked) {
  const Problem problem(FiveArms(3));
  std::stop_source stop;
  stop.request_stop();
  EXPECT_THAT(
      FilteredSubspace(problem.matrix, problem.mass, 60, stop.get_token())
          .status(),
      StatusIs(absl::StatusCode::kCancelled, testing::_));
}

}  // namespace
}  // namespace isomatch
