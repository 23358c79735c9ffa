#include "core/spectral/functional_map.h"

#include <algorithm>
#include <cassert>
#include <vector>

#include <Eigen/Cholesky>

#include "core/base/nearest_columns.h"
#include "core/base/parallel.h"

namespace isomatch {
namespace {

/// Added to the diagonal of the normal equations, as a fraction of its largest
/// entry, so that a few matches still determine a map.
constexpr double kRegularization = 1e-9;
/// The matches are summed up in at most this many parts, at the same time.
constexpr Eigen::Index kParts = 16;
/// Rows gathered at a time.
constexpr Eigen::Index kBlock = 512;

/// Sums over the matches of a part.
struct Sums {
  Eigen::MatrixXd normal;  ///< only if some vertex has no match
  Eigen::MatrixXd right;
};

Sums SumUp(const SpectralBasis& spectral_x, const SpectralBasis& spectral_y,
           absl::Span<const VertexMatch> matches, int k, bool dense) {
  Sums sums;
  sums.right = Eigen::MatrixXd::Zero(k, k);
  if (!dense) sums.normal = Eigen::MatrixXd::Zero(k, k);
  // Transposed: the functions' values at a vertex side by side.
  Eigen::MatrixXd phi_x(k, kBlock);
  Eigen::MatrixXd phi_y(k, kBlock);
  for (std::size_t begin = 0; begin < matches.size(); begin += kBlock) {
    const auto block = matches.subspan(begin, kBlock);
    const auto rows = static_cast<Eigen::Index>(block.size());
    for (Eigen::Index i = 0; i < rows; ++i) {
      const auto [x, y] = block[i];
      phi_x.col(i) =
          spectral_x.mass[x] * spectral_x.functions.row(x).head(k).transpose();
      phi_y.col(i) = spectral_y.functions.row(y).head(k).transpose();
    }
    sums.right.noalias() +=
        phi_x.leftCols(rows) * phi_y.leftCols(rows).transpose();
    if (dense) continue;
    for (Eigen::Index i = 0; i < rows; ++i) {
      phi_y.col(i) = spectral_x.functions.row(block[i].x).head(k).transpose();
    }
    sums.normal.noalias() +=
        phi_x.leftCols(rows) * phi_y.leftCols(rows).transpose();
  }
  return sums;
}

}  // namespace

Eigen::MatrixXd FunctionalMapFromVertexMap(
    const SpectralBasis& spectral_x, const SpectralBasis& spectral_y,
    absl::Span<const VertexIndex> y_from_x, int k) {
  assert(k <= spectral_x.size() && k <= spectral_y.size());
  std::vector<VertexMatch> matches;
  for (std::size_t x = 0; x < y_from_x.size(); ++x) {
    if (y_from_x[x] == kNoVertex) continue;
    matches.push_back({static_cast<VertexIndex>(x), y_from_x[x]});
  }
  const bool dense = matches.size() == y_from_x.size();
  const auto count = static_cast<Eigen::Index>(matches.size());
  const Eigen::Index parts =
      std::clamp<Eigen::Index>((count + kBlock - 1) / kBlock, 1, kParts);
  std::vector<Sums> sums(parts);
  // Never asked to stop: well below a second up to a million vertices.
  const absl::Status status =
      ParallelFor(parts, std::stop_token(), [&](std::int64_t part) {
        const Eigen::Index begin = part * count / parts;
        const Eigen::Index end = (part + 1) * count / parts;
        sums[part] = SumUp(
            spectral_x, spectral_y,
            absl::MakeConstSpan(matches).subspan(begin, end - begin), k, dense);
      });
  assert(status.ok());
  static_cast<void>(status);
  for (Eigen::Index part = 1; part < parts; ++part) {
    sums[0].right += sums[part].right;
    if (!dense) sums[0].normal += sums[part].normal;
  }
  // With every vertex matched the normal matrix is I.
  if (dense) return sums[0].right;
  Eigen::MatrixXd& normal = sums[0].normal;
  normal.diagonal().array() += kRegularization * normal.diagonal().maxCoeff();
  return normal.ldlt().solve(sums[0].right);
}

PointColumns FunctionColumns(const SpectralBasis& spectral, int k) {
  return spectral.functions.leftCols(k).transpose().cast<float>();
}

Eigen::MatrixXf DenseFunctionalMap(
    const Eigen::Ref<const PointColumns>& functions_x,
    const Eigen::VectorXd& mass_x,
    const Eigen::Ref<const PointColumns>& functions_y,
    const VertexMap& y_from_x) {
  const Eigen::Index k = functions_x.rows();
  const auto n = static_cast<Eigen::Index>(y_from_x.size());
  const Eigen::Index parts =
      std::clamp<Eigen::Index>((n + kBlock - 1) / kBlock, 1, kParts);
  std::vector<Eigen::MatrixXf> sums(parts);
  const auto sum_up = [&](std::int64_t part) {
    sums[part] = Eigen::MatrixXf::Zero(k, k);
    const Eigen::Index end = (part + 1) * n / parts;
    Eigen::MatrixXf images(k, kBlock);
    for (Eigen::Index begin = part * n / parts; begin < end; begin += kBlock) {
      const Eigen::Index count = std::min(kBlock, end - begin);
      for (Eigen::Index i = 0; i < count; ++i) {
        images.col(i) = static_cast<float>(mass_x[begin + i]) *
                        functions_y.col(y_from_x[begin + i]);
      }
      sums[part].noalias() += functions_x.middleCols(begin, count) *
                              images.leftCols(count).transpose();
    }
  };
  // Never asked to stop: milliseconds.
  ParallelFor(parts, std::stop_token(), sum_up).IgnoreError();
  for (Eigen::Index part = 1; part < parts; ++part) sums[0] += sums[part];
  return sums[0];
}

void CarryOver(const Eigen::MatrixXf& fmap_x_from_y,
               const Eigen::Ref<const PointColumns>& functions_y,
               Eigen::Ref<PointColumns> carried) {
  const Eigen::Index n = functions_y.cols();
  const auto carry = [&](std::int64_t block) {
    const Eigen::Index begin = block * kBlock;
    const Eigen::Index count = std::min(kBlock, n - begin);
    carried.middleCols(begin, count).noalias() =
        fmap_x_from_y * functions_y.middleCols(begin, count);
  };
  // Never asked to stop: milliseconds.
  ParallelFor((n + kBlock - 1) / kBlock, std::stop_token(), carry)
      .IgnoreError();
}

PointColumns CarriedColumns(const SpectralBasis& spectral_y,
                            const Eigen::MatrixXd& fmap_x_from_y) {
  return (fmap_x_from_y *
          spectral_y.functions.leftCols(fmap_x_from_y.cols()).transpose())
      .cast<float>();
}

}  // namespace isomatch
