#include "core/spectral/functional_map.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include <Eigen/Cholesky>

#include "core/base/nearest_columns.h"

namespace isomatch {
namespace {

/// Of the largest diagonal entry of the normal equations, so that a few matches
/// still determine a map.
constexpr double kRegularisation = 1e-9;
/// Rows gathered at a time.
constexpr Eigen::Index kBlock = 1024;

}  // namespace

Eigen::MatrixXd FunctionalMapFromVertexMap(
    const SpectralBasis& spectral_x, const SpectralBasis& spectral_y,
    absl::Span<const VertexIndex> y_from_x, int k) {
  assert(k <= spectral_x.size() && k <= spectral_y.size());
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(k, k);
  Eigen::MatrixXd right = Eigen::MatrixXd::Zero(k, k);
  Eigen::MatrixXd phi_x(kBlock, k);
  Eigen::MatrixXd phi_y(kBlock, k);
  const auto add_block = [&](Eigen::Index rows) {
    normal.noalias() += phi_x.topRows(rows).transpose() * phi_x.topRows(rows);
    right.noalias() += phi_x.topRows(rows).transpose() * phi_y.topRows(rows);
  };
  Eigen::Index rows = 0;
  bool dense = true;
  for (std::size_t x = 0; x < y_from_x.size(); ++x) {
    const VertexIndex y = y_from_x[x];
    dense = dense && y != kNoVertex;
    if (y == kNoVertex) continue;
    const double weight = std::sqrt(spectral_x.mass[x]);
    phi_x.row(rows) = weight * spectral_x.functions.row(x).head(k);
    phi_y.row(rows) = weight * spectral_y.functions.row(y).head(k);
    if (++rows < kBlock) continue;
    add_block(rows);
    rows = 0;
  }
  add_block(rows);
  // With every vertex matched the normal matrix is I.
  if (dense) return right;
  normal.diagonal().array() += kRegularisation * normal.diagonal().maxCoeff();
  return normal.ldlt().solve(right);
}

absl::StatusOr<VertexMap> VertexMapFromFunctionalMap(
    const SpectralBasis& spectral_x, const SpectralBasis& spectral_y,
    const Eigen::MatrixXd& fmap_x_from_y, const std::stop_token& stop) {
  const PointColumns queries =
      spectral_x.functions.leftCols(fmap_x_from_y.rows())
          .transpose()
          .cast<float>();
  const PointColumns points =
      (fmap_x_from_y *
       spectral_y.functions.leftCols(fmap_x_from_y.cols()).transpose())
          .cast<float>();
  return NearestColumns(queries, points, stop);
}

}  // namespace isomatch
