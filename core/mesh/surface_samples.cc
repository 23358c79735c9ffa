#include "core/mesh/surface_samples.h"

#include <algorithm>

#include "core/base/parallel.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

constexpr double kMostComparisons = 1e8;

PointColumns Gather(const PointColumns& columns,
                    const std::vector<VertexIndex>& vertices) {
  return columns(Eigen::all, vertices);
}

}  // namespace

VertexIndex DescendOverEdges(const PointsOnSurface& x, const PointsOnSurface& y,
                             VertexIndex vertex, VertexIndex start,
                             const VertexMap& before) {
  const auto distance = [&](VertexIndex to) {
    return (x.columns.col(vertex) - y.columns.col(to)).squaredNorm();
  };
  VertexIndex best = start;
  float least = distance(best);
  const auto offer = [&](VertexIndex to) {
    const float found = distance(to);
    if (!(found < least)) return;
    least = found;
    best = to;
  };
  if (!before.empty()) {
    for (const VertexIndex neighbor : x.stars.Neighbors(vertex)) {
      if (before[neighbor] != best) offer(before[neighbor]);
    }
  }
  for (VertexIndex from = kNoVertex; from != best;) {
    from = best;
    for (const VertexIndex to : y.stars.SomeNeighbors(from)) offer(to);
  }
  return best;
}

absl::StatusOr<VertexMap> DescendFromMap(const PointsOnSurface& x,
                                         const PointsOnSurface& y,
                                         const VertexMap& before,
                                         const std::stop_token& stop) {
  VertexMap found(before.size());
  const auto n = static_cast<VertexIndex>(before.size());
  ISOMATCH_RETURN_IF_ERROR(ParallelForVertices(n, stop, [&](VertexIndex v) {
    found[v] = DescendOverEdges(x, y, v, before[v], before);
  }));
  return found;
}

std::vector<VertexIndex> EvenlyByArea(const Eigen::VectorXd& areas,
                                      std::int64_t count) {
  std::vector<VertexIndex> chosen;
  const double step =
      areas.size() <= count ? 0 : areas.sum() / static_cast<double>(count);
  double passed = 0;
  double next = 0.5 * step;
  for (Eigen::Index v = 0; v < areas.size(); ++v) {
    passed += areas[v];
    if (passed < next) continue;
    chosen.push_back(static_cast<VertexIndex>(v));
    while (step > 0 && next <= passed) next += step;
  }
  return chosen;
}

SurfaceSamples SampleSurface(const VertexStars& stars,
                             const Eigen::VectorXd& areas, std::int64_t count) {
  SurfaceSamples samples;
  samples.vertices = EvenlyByArea(areas, count);
  samples.home.assign(areas.size(), -1);
  for (std::size_t i = 0; i < samples.vertices.size(); ++i) {
    samples.home[samples.vertices[i]] = static_cast<int>(i);
  }
  std::vector<VertexIndex> reached = samples.vertices;
  for (std::size_t i = 0; i < reached.size(); ++i) {
    for (const VertexIndex v : stars.Neighbors(reached[i])) {
      if (samples.home[v] >= 0) continue;
      samples.home[v] = samples.home[reached[i]];
      reached.push_back(v);
    }
  }
  return samples;
}

absl::StatusOr<VertexMap> NearestBySamples(const PointsOnSurface& x,
                                           const PointsOnSurface& y,
                                           std::int64_t samples,
                                           const std::stop_token& stop) {
  const SurfaceSamples samples_x = SampleSurface(x.stars, x.areas, samples);
  const std::vector<VertexIndex> samples_y = EvenlyByArea(y.areas, samples);
  ISOMATCH_ASSIGN_OR_RETURN(
      const VertexMap nearest,
      NearestColumns(Gather(x.columns, samples_x.vertices),
                     Gather(y.columns, samples_y), stop));
  const auto n = static_cast<VertexIndex>(x.columns.cols());
  VertexMap nearest_y(n);
  ISOMATCH_RETURN_IF_ERROR(ParallelForVertices(n, stop, [&](VertexIndex v) {
    // A component without a sample starts where the first sample went.
    const int home = std::max(samples_x.home[v], 0);
    nearest_y[v] = DescendOverEdges(x, y, v, samples_y[nearest[home]], {});
  }));
  return DescendFromMap(x, y, nearest_y, stop);
}

absl::StatusOr<VertexMap> NearestOnSurface(const PointsOnSurface& x,
                                           const PointsOnSurface& y,
                                           const std::stop_token& stop) {
  if (double(x.columns.cols()) * double(y.columns.cols()) <= kMostComparisons) {
    return NearestColumns(x.columns, y.columns, stop);
  }
  return NearestBySamples(x, y, kSurfaceSamples, stop);
}

}  // namespace isomatch
