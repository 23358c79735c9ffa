#include "core/spectral/filtered_subspace.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "absl/strings/str_cat.h"
#include "core/base/parallel.h"
#include "core/base/random_stream.h"
#include "core/base/status_macros.h"
#include "core/spectral/block_solver.h"

namespace isomatch {
namespace {

/// Vectors of the block for each that is wanted: what lies beyond is damped by
/// the filter, the faster the farther.
constexpr double kGuard = 1.25;
/// Shift, in eigenvalues that Weyl's law expects at the end of the block.
constexpr double kBlockShift = 0.25;
/// Solves before the first Ritz vectors, and degrees of the filters after that:
/// the first Ritz vectors hold too much of the lowest functions for a higher
/// degree in single precision. The last repeats until the residual is small.
constexpr int kSmoothings = 2;
constexpr int kFirstDegree = 4;
constexpr int kDegree = 8;
constexpr int kMorePasses = 2;
constexpr double kMostResidual = 1e-2;
/// Ritz values below this part of the block are right after the first pass; by
/// Weyl's law they tell the last one, a bit low.
constexpr Eigen::Index kRightPart = 4;
constexpr double kCautious = 0.93;
/// What is less than this, of values in units of the shift, is 0.
constexpr double kZero = 1e-3;
/// Noise of the first vectors, which reaches pieces that none of them is on.
constexpr float kNoise = 1e-3f;
/// Rows that are multiplied at a time.
constexpr Eigen::Index kRows = 512;

/// Some rows of a block.
template <typename Number>
using Rows =
    Eigen::Matrix<Number, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// Ritz pairs of a span.
struct Ritz {
  Eigen::VectorXd values;
  Eigen::MatrixXd turn;  ///< a column for each pair
};

/// Sums up products of a block with itself and its image.
struct Products {
  explicit Products(Eigen::Index size)
      : gram(Eigen::MatrixXd::Zero(size, size)),
        energy(Eigen::MatrixXd::Zero(size, size)) {}

  template <typename Number>
  void Add(const Rows<Number>& rows, const Rows<Number>& image) {
    Eigen::Matrix<Number, Eigen::Dynamic, Eigen::Dynamic> product =
        Rows<Number>::Zero(gram.rows(), gram.cols());
    product.template selfadjointView<Eigen::Lower>().rankUpdate(
        rows.transpose());
    gram += product.template cast<double>();
    product.template triangularView<Eigen::Lower>() = rows.transpose() * image;
    energy += product.template cast<double>();
  }

  /// Ascending. INTERNAL where vectors depend on each other.
  absl::StatusOr<Ritz> Solve() const {
    const Eigen::VectorXd unit = gram.diagonal().cwiseSqrt().cwiseInverse();
    const Eigen::MatrixXd angles = unit.asDiagonal() * gram * unit.asDiagonal();
    const Eigen::LLT<Eigen::MatrixXd> cholesky(angles);
    const absl::Status dependent =
        absl::InternalError("subspace iteration: vectors depend on each other");
    if (cholesky.info() != Eigen::Success) return dependent;
    const Eigen::MatrixXd lower =
        unit.asDiagonal() * energy * unit.asDiagonal();
    Eigen::MatrixXd reduced = lower.selfadjointView<Eigen::Lower>();
    cholesky.matrixL().solveInPlace(reduced);
    cholesky.matrixU().solveInPlace<Eigen::OnTheRight>(reduced);
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> pairs(reduced);
    if (pairs.info() != Eigen::Success || !pairs.eigenvalues().allFinite()) {
      return dependent;
    }
    const Eigen::MatrixXd turn = cholesky.matrixU().solve(pairs.eigenvectors());
    return Ritz{pairs.eigenvalues(), unit.asDiagonal() * turn};
  }

  Eigen::MatrixXd gram;
  Eigen::MatrixXd energy;
};

/// Vectors of one vertex each at even steps of area.
VectorBlock FirstVectors(const BlockSolver& solver, const Eigen::VectorXd& mass,
                         Eigen::Index size) {
  const Eigen::Index n = mass.size();
  VectorBlock x(n, size);
  RandomStream random(1, 0);
  for (float& entry : x.reshaped<Eigen::RowMajor>()) {
    entry = kNoise * static_cast<float>(random.Unit() - 0.5);
  }
  const double step = mass.sum() / static_cast<double>(size);
  double passed = 0;
  Eigen::Index column = 0;
  for (Eigen::Index v = 0; v < n && column < size; ++v) {
    passed += mass[v];
    const bool is_last_chance = n - v <= size - column;
    if (passed < (double(column) + 0.5) * step && !is_last_chance) continue;
    x(solver.row_of_vertex()[v], column++) += 1;
  }
  return x;
}

/// The block, of which the lowest vectors are made to stand out.
class Subspace {
 public:
  /// The solver is that of matrix + I.
  Subspace(const BlockSolver& solver, VectorBlock first,
           const std::stop_token& stop)
      : solver_(solver), stop_(stop), x_(std::move(first)) {}

  absl::Status Smooth() {
    for (int i = 0; i < kSmoothings; ++i) {
      ISOMATCH_RETURN_IF_ERROR(solver_.Solve(stop_, &x_));
    }
    return absl::OkStatus();
  }

  /// Chebyshev polynomial of that degree (>= 1) of the inverse, which is at
  /// most 1 for values from `last` on and grows below.
  absl::Status Filter(int degree, double last) {
    const auto half = static_cast<float>(0.5 / (last + 1));
    before_ = x_;
    ISOMATCH_RETURN_IF_ERROR(solver_.Solve(stop_, &x_));
    x_ = x_ / half - before_;
    for (int i = 2; i <= degree; ++i) {
      inverse_ = x_;
      ISOMATCH_RETURN_IF_ERROR(solver_.Solve(stop_, &inverse_));
      before_ = (2 / half) * inverse_ - 2 * x_ - before_;
      before_.swap(x_);
    }
    return absl::OkStatus();
  }

  /// Ritz pairs of the inverse, as values of the matrix. Where faces are tiny
  /// the matrix itself is too large for single precision.
  absl::StatusOr<Ritz> QuickRitz() {
    inverse_ = x_;
    ISOMATCH_RETURN_IF_ERROR(solver_.Solve(stop_, &inverse_));
    Products products(x_.cols());
    ISOMATCH_RETURN_IF_ERROR(ForRows([&](Eigen::Index first, Eigen::Index n) {
      products.Add<float>(x_.middleRows(first, n),
                          inverse_.middleRows(first, n));
    }));
    ISOMATCH_ASSIGN_OR_RETURN(Ritz ritz, products.Solve());
    if (ritz.values[0] <= 0) {
      return absl::InternalError(
          "subspace iteration: the inverse is not positive");
    }
    ritz.values = (ritz.values.reverse().array().inverse() - 1).matrix().eval();
    ritz.turn = ritz.turn.rowwise().reverse().eval();
    return ritz;
  }

  /// In double precision.
  absl::StatusOr<Ritz> ExactRitz() const {
    Products products(x_.cols());
    ISOMATCH_RETURN_IF_ERROR(ForRows([&](Eigen::Index first, Eigen::Index n) {
      products.Add<double>(x_.middleRows(first, n).cast<double>(),
                           Image(first, n));
    }));
    return products.Solve();
  }

  /// Makes Ritz vectors of the block.
  absl::Status Turn(const Ritz& ritz) {
    const Eigen::MatrixXf turn = ritz.turn.cast<float>();
    VectorBlock rows;
    return ForRows([&](Eigen::Index first, Eigen::Index n) {
      rows = x_.middleRows(first, n);
      x_.middleRows(first, n).noalias() = rows * turn;
    });
  }

  /// The lowest `count` in double precision; no residual yet.
  absl::StatusOr<LowestPairs> Pairs(const Ritz& ritz, int count) const {
    const Eigen::MatrixXd turn = ritz.turn.leftCols(count);
    const Eigen::VectorXi& row_of_vertex = solver_.row_of_vertex();
    Eigen::VectorXi vertex_of_row(x_.rows());
    for (int v = 0; v < x_.rows(); ++v) vertex_of_row[row_of_vertex[v]] = v;
    LowestPairs pairs;
    pairs.values = ritz.values.head(count);
    pairs.vectors.resize(x_.rows(), count);
    Rows<double> rows;
    ISOMATCH_RETURN_IF_ERROR(ForRows([&](Eigen::Index first, Eigen::Index n) {
      rows.noalias() = x_.middleRows(first, n).cast<double>() * turn;
      pairs.vectors(vertex_of_row.segment(first, n), Eigen::all) = rows;
    }));
    return pairs;
  }

  /// LowestPairs::residual of the first `count` vectors, once they are turned.
  absl::StatusOr<double> Residual(const Eigen::VectorXd& values, int count) {
    inverse_ = x_;
    ISOMATCH_RETURN_IF_ERROR(solver_.Solve(stop_, &inverse_));
    const Eigen::VectorXf scale = (values.array() + 1).cast<float>();
    Eigen::VectorXd squares = Eigen::VectorXd::Zero(count);
    ISOMATCH_RETURN_IF_ERROR(ForRows([&](Eigen::Index first, Eigen::Index n) {
      squares +=
          (inverse_.block(first, 0, n, count) * scale.head(count).asDiagonal() -
           x_.block(first, 0, n, count))
              .colwise()
              .squaredNorm()
              .transpose()
              .cast<double>();
    }));
    if (!squares.allFinite()) {
      return absl::InternalError(
          "subspace iteration: residuals are not finite");
    }
    return std::sqrt(squares.maxCoeff());
  }

 private:
  /// Calls f(first, n) for some rows at a time.
  template <typename Function>
  absl::Status ForRows(const Function& f) const {
    for (Eigen::Index first = 0; first < x_.rows(); first += kRows) {
      ISOMATCH_RETURN_IF_ERROR(CheckNotCancelled(stop_));
      f(first, std::min(kRows, x_.rows() - first));
    }
    return absl::OkStatus();
  }

  /// Rows of matrix x.
  Rows<double> Image(Eigen::Index first, Eigen::Index n) const {
    using Sums = Eigen::Array<double, kPanel, 1>;
    using MatrixEntry = Eigen::SparseMatrix<double>::InnerIterator;
    Rows<double> image(n, x_.cols());
    for (Eigen::Index i = 0; i < n; ++i) {
      for (Eigen::Index c = 0; c < x_.cols(); c += kPanel) {
        Sums sum = Sums::Zero();
        for (MatrixEntry entry(solver_.matrix(), first + i); entry; ++entry) {
          sum += entry.value() * x_.row(entry.row())
                                     .segment<kPanel>(c)
                                     .transpose()
                                     .array()
                                     .cast<double>();
        }
        image.row(i).segment<kPanel>(c) = sum;
      }
    }
    return image;
  }

  const BlockSolver& solver_;
  const std::stop_token& stop_;
  VectorBlock x_;
  VectorBlock inverse_;  ///< (matrix + I)^-1 x
  VectorBlock before_;   ///< of the polynomial of one degree less
};

/// The value that lies at the end of the block, as far as the Ritz values tell.
double LastOf(const Eigen::VectorXd& values) {
  const Eigen::Index m = values.size();
  Eigen::Index zeros = 0;  // of pieces
  while (zeros < m && values[zeros] < kZero) ++zeros;
  const Eigen::Index right = zeros + (m - zeros) / kRightPart;
  if (right <= zeros || right >= m) return values[m - 1];
  return std::min(values[m - 1], kCautious * values[right] * double(m - zeros) /
                                     double(right - zeros + 1));
}

}  // namespace

Eigen::Index SubspaceSize(int count) {
  return kPanel * static_cast<Eigen::Index>(std::ceil(kGuard * count / kPanel));
}

absl::StatusOr<LowestPairs> FilteredSubspace(
    const Eigen::SparseMatrix<double>& matrix, const Eigen::VectorXd& mass,
    int count, const std::stop_token& stop) {
  const Eigen::Index m = SubspaceSize(count);
  const double shift =
      kBlockShift * 4 * std::numbers::pi * static_cast<double>(m) / mass.sum();
  // In units of the shift numbers stay within single precision.
  ISOMATCH_ASSIGN_OR_RETURN(const BlockSolver solver,
                            BlockSolver::Create(matrix / shift, 1));
  Subspace subspace(solver, FirstVectors(solver, mass, m), stop);
  ISOMATCH_RETURN_IF_ERROR(subspace.Smooth());
  for (const int degree : {kFirstDegree, kDegree}) {
    ISOMATCH_ASSIGN_OR_RETURN(const Ritz ritz, subspace.QuickRitz());
    ISOMATCH_RETURN_IF_ERROR(subspace.Turn(ritz));
    ISOMATCH_RETURN_IF_ERROR(subspace.Filter(degree, LastOf(ritz.values)));
  }
  double residual = 0;
  for (int more = kMorePasses; more >= 0; --more) {
    ISOMATCH_ASSIGN_OR_RETURN(const Ritz ritz, subspace.ExactRitz());
    ISOMATCH_ASSIGN_OR_RETURN(LowestPairs pairs, subspace.Pairs(ritz, count));
    ISOMATCH_RETURN_IF_ERROR(subspace.Turn(ritz));
    ISOMATCH_ASSIGN_OR_RETURN(residual, subspace.Residual(ritz.values, count));
    pairs.residual = residual;
    if (residual <= kMostResidual) {
      pairs.values *= shift;
      return pairs;
    }
    if (more == 0) break;
    ISOMATCH_RETURN_IF_ERROR(subspace.Filter(kDegree, LastOf(ritz.values)));
  }
  return absl::InternalError(
      absl::StrCat("subspace iteration: residual ", residual,
                   " after all filters, expected at most ", kMostResidual));
}

}  // namespace isomatch
