#include "core/spectral/factor_size.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/OrderingMethods>

#include "absl/strings/str_cat.h"

namespace isomatch {
namespace {

using Matrix = Eigen::SparseMatrix<double>;

double EntriesOfSurface(double n) {
  return 3 * n * std::log2(std::max(n, 2.0));
}

}  // namespace

std::int64_t CountFactorEntries(const Matrix& matrix, std::int64_t most) {
  constexpr int kNone = -1;
  Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> old_from_new;
  Eigen::AMDOrdering<int>()(matrix, old_from_new);
  const auto n = static_cast<int>(matrix.cols());
  std::vector<int> new_from_old(n);
  for (int i = 0; i < n; ++i) new_from_old[old_from_new.indices()[i]] = i;
  std::vector<int> parent(n, kNone);  // in the elimination tree
  std::vector<int> seen_by(n, kNone);
  std::int64_t entries = n;
  for (int row = 0; row < n && entries <= most; ++row) {
    seen_by[row] = row;
    const int old = old_from_new.indices()[row];
    for (Matrix::InnerIterator entry(matrix, old); entry; ++entry) {
      int column = new_from_old[entry.row()];
      // The row of the factor: from each entry up the tree.
      for (; column < row && seen_by[column] != row; column = parent[column]) {
        if (parent[column] == kNone) parent[column] = row;
        seen_by[column] = row;
        ++entries;
      }
    }
  }
  return entries;
}

std::int64_t MostFactorEntries(std::int64_t n) {
  constexpr double kSpare = 3;
  constexpr double kNoBurden = 400'000;
  return static_cast<std::int64_t>(
      std::max(kSpare * EntriesOfSurface(static_cast<double>(n)), kNoBurden));
}

absl::Status CheckFactor(const Matrix& stiffness) {
  const std::int64_t most = MostFactorEntries(stiffness.cols());
  if (CountFactorEntries(stiffness, most) <= most) return absl::OkStatus();
  const double n = static_cast<double>(stiffness.cols());
  return absl::InvalidArgumentError(
      absl::StrCat("connected as no surface is: solved on ", stiffness.cols(),
                   " vertices, a factor of its Laplacian has more than ", most,
                   " entries, that of a surface about ",
                   std::llround(EntriesOfSurface(n) / 2),
                   "; do its faces join the right vertices?"));
}

}  // namespace isomatch
