#pragma once

#include <cstdint>

#include <Eigen/SparseCore>

#include "absl/status/status.h"

namespace isomatch {

/// Returns how many entries the Cholesky factor of a symmetric matrix has in
/// the order of elimination that Eigen's SimplicialLLT takes (approximate
/// minimum degree), or a number beyond `most` as soon as there are more. Time
/// O(entries), memory O(those of the matrix). Source: Davis, Algorithm 849,
/// 2005, Figure 2.
std::int64_t CountFactorEntries(const Eigen::SparseMatrix<double>& matrix,
                                std::int64_t most);

/// What a factor of n rows may have: 9 n log2(n), twice of what surfaces have
/// at most, for their separators are short; and what is no burden.
std::int64_t MostFactorEntries(std::int64_t n);

/// Checks that what is connected as the nonzeros of `stiffness`, of which later
/// factors are made, has a factor of at most MostFactorEntries, so that time
/// and memory are those of a surface. INVALID_ARGUMENT with the numbers if not,
/// as when faces join any vertices.
absl::Status CheckFactor(const Eigen::SparseMatrix<double>& stiffness);

}  // namespace isomatch
