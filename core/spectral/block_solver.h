#pragma once

#include <iterator>
#include <stop_token>
#include <vector>

#include <Eigen/Core>
#include <Eigen/SparseCore>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace isomatch {

/// Vectors side by side, one a column, stored in rows: what is done to one is
/// done to several at a time. Columns are a multiple of kPanel.
using VectorBlock =
    Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// Vectors that are computed with at a time.
inline constexpr int kPanel = 32;

/// Entries of a sparse matrix in rows.
struct SparseRows {
  std::vector<Eigen::Index> starts;  ///< of each row, and the end
  std::vector<int> columns;
  std::vector<float> values;
};

/// A sparse matrix, symmetric and positive definite once it is shifted, that is
/// solved for many right-hand sides at a time: so its factor is read once for
/// each kPanel of them, and every number of it is used in lanes.
///
/// Rows of blocks are in the factor's order of elimination, row_of_vertex().
/// Not in the paper. Deterministic at any thread count.
class BlockSolver {
 public:
  /// Factors matrix + shift I. INTERNAL with the numbers if that fails.
  static absl::StatusOr<BlockSolver> Create(
      const Eigen::SparseMatrix<double>& matrix, double shift);

  Eigen::Index size() const { return std::ssize(inverse_diagonal_); }
  const Eigen::VectorXi& row_of_vertex() const { return row_of_vertex_; }
  /// The matrix without shift: its columns are its rows.
  const Eigen::SparseMatrix<double>& matrix() const { return matrix_; }

  /// Replaces x by (matrix + shift I)^-1 x, in single precision. CANCELLED
  /// after `stop`. Time O(entries of the factor, columns of x).
  absl::Status Solve(const std::stop_token& stop, VectorBlock* x) const;

 private:
  void StoreFactor(const Eigen::SparseMatrix<double>& factor);

  Eigen::VectorXi row_of_vertex_;
  Eigen::SparseMatrix<double> matrix_;
  /// The factor without its diagonal, and its transpose.
  SparseRows lower_;
  SparseRows upper_;
  std::vector<float> inverse_diagonal_;
};

}  // namespace isomatch
