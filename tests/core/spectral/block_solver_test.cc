#include "core/spectral/block_solver.h"

#include <gtest/gtest.h>
#include <Eigen/SparseCholesky>

#include "core/base/parallel.h"
#include "core/spectral/cotan_laplacian.h"
#include "tests/support/matchers.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

constexpr double kShift = 20;

TEST(BlockSolverTest, SolvesAsEigenDoesAtAnyThreadCount) {
  const Eigen::SparseMatrix<double> matrix =
      BuildCotanLaplacian(FiveArms(3)).stiffness;
  const Eigen::Index n = matrix.rows();
  const auto solver = BlockSolver::Create(matrix, kShift);
  ASSERT_THAT(solver, IsOk());
  ASSERT_EQ(solver->size(), n);
  const Eigen::MatrixXd right = Eigen::MatrixXd::Random(n, 3 * kPanel);
  VectorBlock block(n, right.cols());
  for (Eigen::Index v = 0; v < n; ++v) {
    block.row(solver->row_of_vertex()[v]) = right.row(v).cast<float>();
  }
  VectorBlock alone = block;
  RunWithThreads(1, [&] { ASSERT_THAT(solver->Solve({}, &alone), IsOk()); });
  RunWithThreads(4, [&] { ASSERT_THAT(solver->Solve({}, &block), IsOk()); });
  EXPECT_EQ(block, alone);

  Eigen::SparseMatrix<double> shifted = matrix;
  shifted.diagonal().array() += kShift;
  const Eigen::MatrixXd expected =
      Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>>(shifted).solve(right);
  const Eigen::MatrixXd found =
      block(solver->row_of_vertex(), Eigen::all).cast<double>();
  EXPECT_LT((found - expected).norm(), 1e-5 * expected.norm());
}

TEST(BlockSolverTest, KeepsTheMatrixInTheOrderOfElimination) {
  const Eigen::SparseMatrix<double> matrix =
      BuildCotanLaplacian(FiveArms(2)).stiffness;
  const auto solver = BlockSolver::Create(matrix, kShift);
  ASSERT_THAT(solver, IsOk());
  ASSERT_EQ(solver->matrix().nonZeros(), matrix.nonZeros());
  const Eigen::VectorXi& row = solver->row_of_vertex();
  for (Eigen::Index v = 0; v < matrix.cols(); ++v) {
    const Eigen::VectorXd dense = solver->matrix().col(row[v]);
    EXPECT_EQ(Eigen::VectorXd(dense(row)), Eigen::VectorXd(matrix.col(v)));
  }
}

TEST(BlockSolverTest, NegativeMatricesAreRefused) {
  Eigen::SparseMatrix<double> matrix(2, 2);
  matrix.insert(0, 0) = -1;
  matrix.insert(1, 1) = -1;
  EXPECT_THAT(BlockSolver::Create(matrix, 0.5).status(),
              StatusIs(absl::StatusCode::kInternal,
                       testing::HasSubstr("2 vertices, shift 0.5")));
}

TEST(BlockSolverTest, StopsWhenAsked) {
  const auto solver =
      BlockSolver::Create(BuildCotanLaplacian(FiveArms(2)).stiffness, kShift);
  ASSERT_THAT(solver, IsOk());
  std::stop_source stop;
  stop.request_stop();
  VectorBlock block = VectorBlock::Ones(solver->size(), kPanel);
  EXPECT_THAT(solver->Solve(stop.get_token(), &block),
              StatusIs(absl::StatusCode::kCancelled, testing::_));
}

}  // namespace
}  // namespace isomatch
