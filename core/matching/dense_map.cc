#include "core/matching/dense_map.h"

#include <cstdint>
#include <vector>

#include "core/base/nearest_columns.h"
#include "core/base/parallel.h"
#include "core/base/status_macros.h"
#include "core/mesh/surface_samples.h"

namespace isomatch {
namespace {

/// Samples a side that are compared; closeness has one valley around there.
constexpr std::int64_t kSamples = 1500;

/// Closeness of every vertex, one a column, to the matched ones.
absl::StatusOr<PointColumns> ClosenessColumns(
    const Closeness& closeness, const std::vector<VertexIndex>& matched,
    const std::stop_token& stop) {
  const VertexIndex n = closeness.basis().num_vertices();
  PointColumns columns(matched.size(), n);
  const ClosenessRows rows(closeness, matched);
  ISOMATCH_RETURN_IF_ERROR(ParallelForVertices(
      n, stop, [&](VertexIndex v) { rows.Row(v, columns.col(v).data()); }));
  return columns;
}

}  // namespace

absl::StatusOr<VertexMap> DenseMapFromMatches(
    const DenseMapSurface& x, const DenseMapSurface& y,
    absl::Span<const VertexMatch> matches, const std::stop_token& stop) {
  std::vector<VertexIndex> matched_x;
  std::vector<VertexIndex> matched_y;
  for (const VertexMatch& match : matches) {
    matched_x.push_back(match.x);
    matched_y.push_back(match.y);
  }
  ISOMATCH_ASSIGN_OR_RETURN(const PointColumns columns_x,
                            ClosenessColumns(x.closeness, matched_x, stop));
  ISOMATCH_ASSIGN_OR_RETURN(const PointColumns columns_y,
                            ClosenessColumns(y.closeness, matched_y, stop));
  return NearestBySamples({x.stars, x.areas, columns_x},
                          {y.stars, y.areas, columns_y}, kSamples, stop);
}

}  // namespace isomatch
