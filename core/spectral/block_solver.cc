#include "core/spectral/block_solver.h"

#include <cstdint>
#include <iterator>

#include <Eigen/SparseCholesky>

#include "absl/strings/str_cat.h"
#include "core/base/parallel.h"

namespace isomatch {
namespace {

using Entry = Eigen::SparseMatrix<double>::InnerIterator;
using PanelRow = Eigen::Array<float, kPanel, 1>;

/// x_i = (x_i - sum over row i) / diagonal.
void SolveRow(const SparseRows& factor, float inverse, Eigen::Index i,
              Eigen::Index stride, float* panel) {
  Eigen::Map<PanelRow> own(panel + i * stride);
  PanelRow sum = own;
  for (Eigen::Index k = factor.starts[i]; k < factor.starts[i + 1]; ++k) {
    sum -= factor.values[k] *
           Eigen::Map<const PanelRow>(panel + factor.columns[k] * stride);
  }
  own = sum * inverse;
}

/// Appends column i, but for its diagonal, as a row.
void AddRow(const Eigen::SparseMatrix<double>& by_column, Eigen::Index i,
            SparseRows* rows) {
  for (Entry entry(by_column, i); entry; ++entry) {
    if (entry.row() == i) continue;
    rows->columns.push_back(static_cast<int>(entry.row()));
    rows->values.push_back(static_cast<float>(entry.value()));
  }
  rows->starts.push_back(std::ssize(rows->columns));
}

void Reserve(Eigen::Index rows, Eigen::Index entries, SparseRows* matrix) {
  matrix->starts.reserve(rows + 1);
  matrix->starts = {0};
  matrix->columns.reserve(entries);
  matrix->values.reserve(entries);
}

}  // namespace

absl::StatusOr<BlockSolver> BlockSolver::Create(
    const Eigen::SparseMatrix<double>& matrix, double shift) {
  Eigen::SparseMatrix<double> shifted = matrix;
  shifted.diagonal().array() += shift;
  const Eigen::SimplicialLLT<Eigen::SparseMatrix<double>> cholesky(shifted);
  if (cholesky.info() != Eigen::Success) {
    return absl::InternalError(
        absl::StrCat("Cholesky factorization of the Laplacian failed, ",
                     matrix.rows(), " vertices, shift ", shift));
  }
  BlockSolver solver;
  solver.row_of_vertex_ = cholesky.permutationP().indices();
  solver.StoreFactor(cholesky.matrixL().nestedExpression());
  solver.matrix_ =
      cholesky.permutationP() * matrix * cholesky.permutationPinv();
  return solver;
}

void BlockSolver::StoreFactor(const Eigen::SparseMatrix<double>& factor) {
  const Eigen::Index n = factor.cols();
  inverse_diagonal_.reserve(n);
  Reserve(n, factor.nonZeros() - n, &upper_);
  Reserve(n, factor.nonZeros() - n, &lower_);
  for (Eigen::Index i = 0; i < n; ++i) {
    inverse_diagonal_.push_back(static_cast<float>(1 / factor.coeff(i, i)));
    AddRow(factor, i, &upper_);
  }
  const Eigen::SparseMatrix<double> transposed = factor.transpose();
  for (Eigen::Index i = 0; i < n; ++i) AddRow(transposed, i, &lower_);
}

absl::Status BlockSolver::Solve(const std::stop_token& stop,
                                VectorBlock* x) const {
  return ParallelFor(x->cols() / kPanel, stop, [&](std::int64_t p) {
    float* const panel = x->data() + p * kPanel;
    for (Eigen::Index i = 0; i < size(); ++i) {
      SolveRow(lower_, inverse_diagonal_[i], i, x->cols(), panel);
    }
    for (Eigen::Index i = size() - 1; i >= 0; --i) {
      SolveRow(upper_, inverse_diagonal_[i], i, x->cols(), panel);
    }
  });
}

}  // namespace isomatch
