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
/// The gain of an exchange is summed over this many nearest matched vertices of
/// each of the two, and this many candidates of nearest images are compared:
/// with all of the environments, which grow as sqrt(n), 100,000 vertices would
/// take half an hour.
constexpr std::size_t kMostMatched = 64;
constexpr std::size_t kMostCandidates = 64;
/// Gains below this are rounding of single-precision sums.
constexpr double kLeastGain = 1e-6;

std::vector<float> ClosenessTo(const HashedShape& shape, VertexIndex v,
                               const std::vector<VertexIndex>& vertices) {
  std::vector<float> row(vertices.size());
  shape.closeness.Row(v, vertices, row.data());
  return row;
}

/// The matched vertices of E(x) but for x, in increasing order.
std::vector<VertexIndex> MatchedAround(const HashedShape& shape_x,
                                       const PartialVertexMap& map,
                                       VertexIndex x) {
  std::vector<VertexIndex> around =
      MergedEnvironment(shape_x, x, kEnvironmentSize);
  std::erase_if(around, [&](VertexIndex v) {
    return v == x || map.y_from_x[v] == kNoVertex;
  });
  return around;
}

VertexMap ImagesOf(const PartialVertexMap& map,
                   const std::vector<VertexIndex>& vertices) {
  VertexMap images;
  images.reserve(vertices.size());
  for (const VertexIndex v : vertices) images.push_back(map.y_from_x[v]);
  return images;
}

/// Returns the `count` of the sorted `vertices` that are nearest to v, in
/// increasing order.
std::vector<VertexIndex> NearestOf(const HashedShape& shape, VertexIndex v,
                                   std::vector<VertexIndex> vertices,
                                   std::size_t count) {
  if (vertices.size() <= count) return vertices;
  const std::vector<float> closeness = ClosenessTo(shape, v, vertices);
  const std::vector<int> nearest =
      ClosestOf(closeness.data(), static_cast<int>(vertices.size()),
                /*self=*/-1, static_cast<int>(count));
  std::vector<VertexIndex> kept;
  kept.reserve(nearest.size());
  for (const int i : nearest) kept.push_back(vertices[i]);
  std::sort(kept.begin(), kept.end());
  return kept;
}

/// The matched vertices of least contribution, smallest index first.
absl::StatusOr<std::vector<VertexIndex>> WorstContributors(
    const HashedPair& shapes, double fraction, const PartialVertexMap& map,
    const std::stop_token& stop) {
  std::vector<std::pair<double, VertexIndex>> ranked;
  for (std::size_t i = 0; i < map.y_from_x.size(); ++i) {
    if (map.y_from_x[i] == kNoVertex) continue;
    ranked.emplace_back(0, static_cast<VertexIndex>(i));
  }
  ISOMATCH_RETURN_IF_ERROR(ParallelFor(
      static_cast<std::int64_t>(ranked.size()), stop, [&](std::int64_t i) {
        auto& [contribution, x] = ranked[i];
        contribution = Contribution(shapes.x, shapes.y, map, x);
      }));
  std::sort(ranked.begin(), ranked.end());
  ranked.resize(static_cast<std::size_t>(fraction * ranked.size()));
  std::vector<VertexIndex> worst;
  worst.reserve(ranked.size());
  for (const auto& [contribution, x] : ranked) worst.push_back(x);
  std::sort(worst.begin(), worst.end());
  return worst;
}

/// Exchanges images among the worst matches, one after the other.
class FinalSwapping {
 public:
  FinalSwapping(const HashedPair& shapes, std::vector<VertexIndex> worst,
                PartialVertexMap* map)
      : shape_x_(shapes.x),
        shape_y_(shapes.y),
        worst_(std::move(worst)),
        map_(*map),
        number_(map->y_from_x.size(), kNone),
        around_(worst_.size()) {
    for (std::size_t i = 0; i < worst_.size(); ++i) {
      number_[worst_[i]] = static_cast<int>(i);
    }
  }

  absl::Status Run(const Control& control) {
    // Exchanges change images, not which vertices are matched: who is around
    // whom stays.
    ISOMATCH_RETURN_IF_ERROR(ParallelFor(
        static_cast<std::int64_t>(worst_.size()), control.stop,
        [&](std::int64_t i) {
          around_[i] =
              NearestOf(shape_x_, worst_[i],
                        MatchedAround(shape_x_, map_, worst_[i]), kMostMatched);
        }));
    for (std::size_t i = 0; i < worst_.size(); ++i) {
      ISOMATCH_RETURN_IF_ERROR(CheckNotCancelled(control.stop));
      SwapWithBest(worst_[i]);
      if (control.progress) control.progress(double(i + 1) / worst_.size());
    }
    return CheckNotCancelled(control.stop);
  }

 private:
  static constexpr int kNone = -1;

  /// Exchanges x with the candidate that gains most; no change if none gains.
  void SwapWithBest(VertexIndex x) {
    const VertexIndex y = map_.y_from_x[x];
    std::vector<VertexIndex> images =
        MergedEnvironment(shape_y_, y, kEnvironmentSize);
    std::erase_if(images, [&](VertexIndex image) {
      const VertexIndex other = map_.x_from_y[image];
      return other == kNoVertex || other == x || number_[other] == kNone;
    });
    VertexIndex best = kNoVertex;
    double most = kLeastGain;
    for (const VertexIndex image :
         NearestOf(shape_y_, y, std::move(images), kMostCandidates)) {
      const VertexIndex other = map_.x_from_y[image];
      const double gain = SwapGain(x, other);
      if (gain <= most) continue;
      most = gain;
      best = other;
    }
    if (best == kNoVertex) return;
    map_.Set(x, map_.y_from_x[best]);
    map_.Set(best, y);
  }

  /// What x and other gain together by exchanging their images. Both
  /// contributions run over what is around both, so that the gain is the change
  /// of Eq. 4 there; their own pair keeps its two closeness values.
  double SwapGain(VertexIndex x, VertexIndex other) const {
    const auto& near_x = around_[number_[x]];
    const auto& near_other = around_[number_[other]];
    std::vector<VertexIndex> around;
    std::set_union(near_x.begin(), near_x.end(), near_other.begin(),
                   near_other.end(), std::back_inserter(around));
    std::erase_if(around, [&](VertexIndex v) { return v == x || v == other; });
    const VertexMap images = ImagesOf(map_, around);
    const auto from_x = ClosenessTo(shape_x_, x, around);
    const auto from_other = ClosenessTo(shape_x_, other, around);
    const auto from_y = ClosenessTo(shape_y_, map_.y_from_x[x], images);
    const auto from_y_other =
        ClosenessTo(shape_y_, map_.y_from_x[other], images);
    double gain = 0;
    for (std::size_t i = 0; i < around.size(); ++i) {
      gain += (double{from_x[i]} - from_other[i]) *
              (double{from_y_other[i]} - from_y[i]);
    }
    return gain;
  }

  const HashedShape& shape_x_;
  const HashedShape& shape_y_;
  const std::vector<VertexIndex> worst_;
  PartialVertexMap& map_;
  std::vector<int> number_;  ///< of each vertex in worst_, or kNone
  /// The matched vertices nearest to each of worst_.
  std::vector<std::vector<VertexIndex>> around_;
};

}  // namespace

double Contribution(const HashedShape& shape_x, const HashedShape& shape_y,
                    const PartialVertexMap& map, VertexIndex x) {
  const std::vector<VertexIndex> around = MatchedAround(shape_x, map, x);
  const auto on_x = ClosenessTo(shape_x, x, around);
  const auto on_y =
      ClosenessTo(shape_y, map.y_from_x[x], ImagesOf(map, around));
  double sum = 0;
  for (std::size_t i = 0; i < on_x.size(); ++i)
    sum += double{on_x[i]} * on_y[i];
  return sum;
}

absl::Status SwapWorst(const HashedPair& shapes, double fraction,
                       const Control& control, PartialVertexMap* map) {
  ISOMATCH_ASSIGN_OR_RETURN(
      std::vector<VertexIndex> worst,
      WorstContributors(shapes, fraction, *map, control.stop));
  return FinalSwapping(shapes, std::move(worst), map).Run(control);
}

}  // namespace isomatch
