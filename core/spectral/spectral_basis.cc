#include "core/spectral/spectral_basis.h"

#include <algorithm>
#include <cmath>
#include <new>
#include <stdexcept>
#include <utility>

#include <Spectra/SymEigsShiftSolver.h>
#include <Eigen/Eigenvalues>
#include <Eigen/SparseCholesky>

#include "absl/strings/str_cat.h"
#include "core/base/parallel.h"
#include "core/base/status_macros.h"
#include "core/spectral/filtered_subspace.h"

namespace isomatch {
namespace {

/// Meshes up to this size, or bases near it, are solved densely.
constexpr int kDenseVertices = 500;
/// Shift below the spectrum that makes L regular, in units of 1 / area.
constexpr double kShift = 0.01;
/// Relative error of Ritz values. Far below the error of the discretization, as
/// a looser one stops before rounding has brought out all copies of the
/// repeated eigenvalues of symmetric shapes.
constexpr double kTolerance = 1e-10;
/// Bodies and animals take 2.
constexpr int kMaxRestarts = 20;
/// The same error where that many do not suffice: eigenvalues accumulate below
/// the last that is wanted, as those of many like pieces that hang together by
/// little do, and what lies closer than this need not be told apart.
constexpr double kCoarseTolerance = 1e-4;

/// y = (A + shift I)^-1 x for Spectra. Spectra cannot be interrupted, so a
/// stop throws out of its loop; the exception does not leave this file.
class ShiftedInverse {
 public:
  using Scalar = double;
  struct Cancelled {};

  ShiftedInverse(const Eigen::SparseMatrix<double>& matrix, double shift,
                 const std::stop_token& stop)
      : stop_(stop) {
    Eigen::SparseMatrix<double> shifted = matrix;
    shifted.diagonal().array() += shift;
    cholesky_.compute(shifted);
  }

  bool ok() const { return cholesky_.info() == Eigen::Success; }
  Eigen::Index rows() const { return cholesky_.rows(); }
  Eigen::Index cols() const { return cholesky_.cols(); }
  void set_shift(double) {}
  void perform_op(const double* x, double* y) const {
    if (stop_.stop_requested()) throw Cancelled();
    Eigen::Map<Eigen::VectorXd>(y, rows()) =
        cholesky_.solve(Eigen::Map<const Eigen::VectorXd>(x, rows()));
  }

 private:
  const std::stop_token& stop_;
  Eigen::SimplicialLLT<Eigen::SparseMatrix<double>> cholesky_;
};

/// Tells what it has found so far, too.
class LanczosSolver : public Spectra::SymEigsShiftSolver<ShiftedInverse> {
 public:
  LanczosSolver(ShiftedInverse& inverse, int count, int subspace, double shift)
      : SymEigsShiftSolver(inverse, count, subspace, -shift), shift_(shift) {}

  /// The lowest `count` Ritz pairs of the subspace as it is; false where one of
  /// them is off by more than `tolerance`.
  bool RitzPairs(int count, double tolerance, SpectralBasis* basis) const {
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> ritz(m_fac.matrix_H());
    if (ritz.info() != Eigen::Success) return false;
    // Of the inverse: the largest are the lowest.
    const Eigen::ArrayXd values = ritz.eigenvalues().tail(count).reverse();
    const Eigen::MatrixXd vectors =
        ritz.eigenvectors().rightCols(count).rowwise().reverse();
    const Eigen::ArrayXd residuals =
        vectors.bottomRows(1).transpose().cwiseAbs() * m_fac.f_norm();
    if (!(residuals <= tolerance * values).all()) return false;
    basis->eigenvalues = values.inverse() - shift_;
    basis->functions = m_fac.matrix_V() * vectors;
    return true;
  }

 private:
  double shift_;
};

absl::Status SolveDense(const Eigen::SparseMatrix<double>& matrix, int count,
                        SpectralBasis* basis) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver{
      Eigen::MatrixXd(matrix)};
  if (solver.info() != Eigen::Success) {
    return absl::InternalError(absl::StrCat(
        "dense eigen-solver failed on a mesh of ", matrix.rows(), " vertices"));
  }
  basis->eigenvalues = solver.eigenvalues().head(count);
  basis->functions = solver.eigenvectors().leftCols(count);
  return absl::OkStatus();
}

absl::Status SolveFiltered(const Eigen::SparseMatrix<double>& matrix,
                           const Eigen::VectorXd& mass, int count,
                           const std::stop_token& stop, SpectralBasis* basis) {
  ISOMATCH_ASSIGN_OR_RETURN(LowestPairs pairs,
                            FilteredSubspace(matrix, mass, count, stop));
  basis->eigenvalues = std::move(pairs.values);
  basis->functions = std::move(pairs.vectors);
  return absl::OkStatus();
}

absl::Status SolveLanczos(const Eigen::SparseMatrix<double>& matrix,
                          double shift, int count, const std::stop_token& stop,
                          SpectralBasis* basis) {
  ShiftedInverse inverse(matrix, shift, stop);
  if (!inverse.ok()) {
    return absl::InternalError(
        absl::StrCat("Cholesky factorization of the Laplacian failed, ",
                     matrix.rows(), " vertices, shift ", shift));
  }
  // Smaller ones restart more often and are a third faster, but converge before
  // rounding has brought out all copies of a sphere's eigenvalues.
  const int subspace =
      std::min<int>(LanczosSubspace(count), static_cast<int>(matrix.rows()));
  LanczosSolver solver(inverse, count, subspace, shift);
  try {
    solver.init();
    solver.compute(Spectra::SortRule::LargestMagn, kMaxRestarts, kTolerance,
                   Spectra::SortRule::SmallestAlge);
  } catch (const ShiftedInverse::Cancelled&) {
    return absl::CancelledError("cancelled");
  } catch (const std::bad_alloc&) {
    throw;  // the caller's: it means the machine, not the mesh
  } catch (const std::exception& error) {
    return absl::InternalError(absl::StrCat("Lanczos: ", error.what()));
  }
  if (solver.info() == Spectra::CompInfo::Successful) {
    basis->eigenvalues = solver.eigenvalues();
    basis->functions = solver.eigenvectors();
  } else if (!solver.RitzPairs(count, kCoarseTolerance, basis)) {
    return absl::InternalError(absl::StrCat(
        "Lanczos found fewer than ", count, " eigenpairs on ", matrix.rows(),
        " vertices after ", kMaxRestarts, " restarts"));
  }
  return absl::OkStatus();
}

}  // namespace

int LanczosSubspace(int count) { return 2 * count + 20; }

bool IsSolvedDensely(double n, int count) {
  return n <= std::max(kDenseVertices, 2 * count);
}

absl::StatusOr<SpectralBasis> ComputeSpectralBasis(
    const CotanLaplacian& laplacian, int count, const std::stop_token& stop) {
  ISOMATCH_RETURN_IF_ERROR(CheckNotCancelled(stop));
  const Eigen::SparseMatrix<double> matrix = NormalizedStiffness(laplacian);
  const Eigen::Index n = matrix.rows();
  const int wanted = static_cast<int>(std::min<Eigen::Index>(count, n));
  SpectralBasis basis;
  basis.mass = laplacian.mass;
  if (IsSolvedDensely(double(n), wanted)) {
    ISOMATCH_RETURN_IF_ERROR(SolveDense(matrix, wanted, &basis));
  } else {
    absl::Status status =
        SolveFiltered(matrix, laplacian.mass, wanted, stop, &basis);
    // A block is no match for eigenvalues that accumulate just beyond it.
    if (absl::IsInternal(status)) {
      status = SolveLanczos(matrix, kShift / laplacian.mass.sum(), wanted, stop,
                            &basis);
    }
    ISOMATCH_RETURN_IF_ERROR(status);
  }
  basis.functions =
      laplacian.mass.cwiseSqrt().cwiseInverse().asDiagonal() * basis.functions;
  return basis;
}

}  // namespace isomatch
