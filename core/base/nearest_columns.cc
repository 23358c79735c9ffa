#include "core/base/nearest_columns.h"

#include <algorithm>
#include <cassert>
#include <limits>
#include <vector>

#include "core/base/parallel.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

// Block sizes keep the product in the second-level cache.
constexpr Eigen::Index kQueryBlock = 128;
constexpr Eigen::Index kPointBlock = 512;

/// Scans one block of queries over all points.
void NearestOfBlock(const PointColumns& queries, const PointColumns& points,
                    const Eigen::VectorXf& half_norms, Eigen::Index begin,
                    Eigen::Index count, VertexIndex* nearest) {
  std::vector<float> best(count, std::numeric_limits<float>::infinity());
  std::fill(nearest, nearest + count, 0);
  Eigen::MatrixXf scores;
  for (Eigen::Index p = 0; p < points.cols(); p += kPointBlock) {
    const Eigen::Index width = std::min(kPointBlock, points.cols() - p);
    // |q - p|^2 = |q|^2 + 2 (|p|^2 / 2 - q.p), and |q|^2 does not matter.
    scores.noalias() = -points.middleCols(p, width).transpose() *
                       queries.middleCols(begin, count);
    scores.colwise() += half_norms.segment(p, width);
    for (Eigen::Index q = 0; q < count; ++q) {
      Eigen::Index row;
      const float score = scores.col(q).minCoeff(&row);
      if (score >= best[q]) continue;
      best[q] = score;
      nearest[q] = static_cast<VertexIndex>(p + row);
    }
  }
}

}  // namespace

absl::StatusOr<VertexMap> NearestColumns(const PointColumns& queries,
                                         const PointColumns& points,
                                         const std::stop_token& stop) {
  assert(queries.rows() == points.rows() && points.cols() > 0);
  const Eigen::VectorXf half_norms =
      0.5f * points.colwise().squaredNorm().transpose();
  VertexMap nearest(queries.cols());
  const Eigen::Index blocks = (queries.cols() + kQueryBlock - 1) / kQueryBlock;
  ISOMATCH_RETURN_IF_ERROR(ParallelFor(blocks, stop, [&](std::int64_t block) {
    const Eigen::Index begin = block * kQueryBlock;
    const Eigen::Index count = std::min(kQueryBlock, queries.cols() - begin);
    NearestOfBlock(queries, points, half_norms, begin, count,
                   nearest.data() + begin);
  }));
  return nearest;
}

}  // namespace isomatch
