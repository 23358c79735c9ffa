#include "core/matching/final_swapping.h"

#include <algorithm>
#include <iterator>
#include <utility>
#include <vector>

#include "core/base/parallel.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

/// Basis points whose environments make up E(x).
constexpr int kEnvironmentSize = 3;
/// Gains below this are rounding of single-precision sums.
constexpr double kLeastGain = 1e-6;

/// The matched vertices around one of X or more, and their images.
struct Neighborhood {
  std::vector<VertexIndex> vertices;
  std::vector<VertexIndex> images;
};

/// Of the sorted `vertices`, those that are matched and none of the two.
Neighborhood Matched(const PartialVertexMap& map,
                     const std::vector<VertexIndex>& vertices, VertexIndex x,
                     VertexIndex other) {
  Neighborhood around;
  for (const VertexIndex v : vertices) {
    if (v == x || v == other || map.y_from_x[v] == kNoVertex) continue;
    around.vertices.push_back(v);
    around.images.push_back(map.y_from_x[v]);
  }
  return around;
}

std::vector<float> ClosenessTo(const HashedShape& shape, VertexIndex v,
                               const std::vector<VertexIndex>& vertices) {
  std::vector<float> row(vertices.size());
  shape.closeness.Row(v, vertices, row.data());
  return row;
}

/// What x and other gain together by exchanging their images. Both
/// contributions run over the environments of both, so that the gain is the
/// change of Eq. 4 there; their own pair keeps its two closeness values.
double SwapGain(const HashedShape& shape_x, const HashedShape& shape_y,
                const PartialVertexMap& map,
                const std::vector<VertexIndex>& near_x, VertexIndex x,
                VertexIndex other) {
  const std::vector<VertexIndex> near_other =
      MergedEnvironment(shape_x, other, kEnvironmentSize);
  std::vector<VertexIndex> near;
  std::set_union(near_x.begin(), near_x.end(), near_other.begin(),
                 near_other.end(), std::back_inserter(near));
  const Neighborhood around = Matched(map, near, x, other);
  const auto from_x = ClosenessTo(shape_x, x, around.vertices);
  const auto from_other = ClosenessTo(shape_x, other, around.vertices);
  const auto from_y = ClosenessTo(shape_y, map.y_from_x[x], around.images);
  const auto from_y_other =
      ClosenessTo(shape_y, map.y_from_x[other], around.images);
  double gain = 0;
  for (std::size_t i = 0; i < from_x.size(); ++i) {
    gain += (double{from_x[i]} - from_other[i]) *
            (double{from_y_other[i]} - from_y[i]);
  }
  return gain;
}

/// The matched vertices of least contribution, smallest index first.
std::vector<VertexIndex> WorstContributors(const HashedShape& shape_x,
                                           const HashedShape& shape_y,
                                           double fraction,
                                           const PartialVertexMap& map,
                                           const std::stop_token& stop) {
  std::vector<std::pair<double, VertexIndex>> ranked;
  for (std::size_t i = 0; i < map.y_from_x.size(); ++i) {
    const auto x = static_cast<VertexIndex>(i);
    if (map.y_from_x[x] == kNoVertex || stop.stop_requested()) continue;
    ranked.emplace_back(Contribution(shape_x, shape_y, map, x), x);
  }
  std::sort(ranked.begin(), ranked.end());
  ranked.resize(static_cast<std::size_t>(fraction * ranked.size()));
  std::vector<VertexIndex> worst;
  for (const auto& [contribution, x] : ranked) worst.push_back(x);
  std::sort(worst.begin(), worst.end());
  return worst;
}

/// Exchanges x with the candidate that gains most; no change if none gains.
void SwapWithBest(const HashedShape& shape_x, const HashedShape& shape_y,
                  const std::vector<char>& is_candidate, VertexIndex x,
                  PartialVertexMap* map) {
  const std::vector<VertexIndex> near_x =
      MergedEnvironment(shape_x, x, kEnvironmentSize);
  VertexIndex best = kNoVertex;
  double most = kLeastGain;
  for (const VertexIndex y :
       MergedEnvironment(shape_y, map->y_from_x[x], kEnvironmentSize)) {
    const VertexIndex other = map->x_from_y[y];
    if (other == kNoVertex || other == x || !is_candidate[other]) continue;
    const double gain = SwapGain(shape_x, shape_y, *map, near_x, x, other);
    if (gain <= most) continue;
    most = gain;
    best = other;
  }
  if (best == kNoVertex) return;
  const VertexIndex y = map->y_from_x[x];
  map->Set(x, map->y_from_x[best]);
  map->Set(best, y);
}

}  // namespace

double Contribution(const HashedShape& shape_x, const HashedShape& shape_y,
                    const PartialVertexMap& map, VertexIndex x) {
  const Neighborhood around =
      Matched(map, MergedEnvironment(shape_x, x, kEnvironmentSize), x, x);
  const auto on_x = ClosenessTo(shape_x, x, around.vertices);
  const auto on_y = ClosenessTo(shape_y, map.y_from_x[x], around.images);
  double sum = 0;
  for (std::size_t i = 0; i < on_x.size(); ++i)
    sum += double{on_x[i]} * on_y[i];
  return sum;
}

absl::Status SwapWorst(const HashedShape& shape_x, const HashedShape& shape_y,
                       double fraction,
                       const std::function<void(double)>& progress,
                       const std::stop_token& stop, PartialVertexMap* map) {
  const std::vector<VertexIndex> worst =
      WorstContributors(shape_x, shape_y, fraction, *map, stop);
  std::vector<char> is_candidate(map->y_from_x.size(), false);
  for (const VertexIndex x : worst) is_candidate[x] = true;
  for (std::size_t i = 0; i < worst.size(); ++i) {
    ISOMATCH_RETURN_IF_ERROR(CheckNotCancelled(stop));
    SwapWithBest(shape_x, shape_y, is_candidate, worst[i], map);
    if (progress) progress(double(i + 1) / worst.size());
  }
  return CheckNotCancelled(stop);
}

}  // namespace isomatch
