#pragma once

#include <stop_token>

#include <Eigen/Core>
#include <Eigen/SparseCore>

#include "absl/status/statusor.h"

namespace isomatch {

/// The lowest eigenpairs of a symmetric matrix.
struct LowestPairs {
  Eigen::VectorXd values;   ///< k, ascending
  Eigen::MatrixXd vectors;  ///< n x k, orthonormal
  /// |(matrix + shift I)^-1 v (value + shift) - v| of the worst pair: at most
  /// 0.01.
  double residual = 0;
};

/// Vectors of the block that `count` pairs are found with.
Eigen::Index SubspaceSize(int count);

/// Returns the lowest `count` eigenpairs of M^-1/2 L M^-1/2, L the stiffness
/// and M the mass (squared mesh units) of a surface, by subspace iteration: a
/// block of vectors, at first one vertex each at even steps of area and a
/// little noise, is filtered by Chebyshev polynomials of (matrix + shift I)^-1,
/// which damp what lies beyond the block's last eigenvalue, and turned to Ritz
/// vectors in between. Being a block it finds all copies of a repeated
/// eigenvalue at once. What a residual cannot show is a pair that is missing.
///
/// Blocks are in single precision, the last Ritz vectors in double.
///
/// Source: Zhou, Saad, Tiago, Chelikowsky: Self-consistent-field calculations
/// using Chebyshev-filtered subspace iteration, 2006, Algorithm 4.1, here of
/// the inverse. INTERNAL where the factorization fails, vectors become
/// dependent, or a residual stays larger than it may be. CANCELLED after
/// `stop`. Deterministic at any thread count. Memory 12 n SubspaceSize(count) +
/// 8 n count bytes.
///
/// REQUIRES: n >= SubspaceSize(count).
absl::StatusOr<LowestPairs> FilteredSubspace(
    const Eigen::SparseMatrix<double>& matrix, const Eigen::VectorXd& mass,
    int count, const std::stop_token& stop);

}  // namespace isomatch
