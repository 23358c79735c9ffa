#include "core/matching/overlap_growth.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <iterator>
#include <numeric>
#include <utility>

#include "absl/types/span.h"
#include "core/base/parallel.h"
#include "core/base/status_macros.h"
#include "core/matching/near_points.h"
#include "core/matching/orientation.h"
#include "core/matching/witnesses.h"

namespace isomatch {
namespace {

constexpr float kNever = 9;
/// Points stay out above this cost.
constexpr float kMostCost = 0.42f;
/// Part of the cost that tells how unlike two points look.
constexpr float kUnlikeness = 0.35f;
/// Matched neighbors that say where a point belongs, how far away they may be,
/// and over what distance they count less.
constexpr int kGrowthNeighbors = 8;
constexpr float kGrowthReach = 0.2f;
constexpr float kNearWidth = 0.12f;
/// How many times as far away they may be in the first pass, when there are
/// few, and in the others.
constexpr float kFirstReaches = 4;
constexpr float kNextReaches = 1.5f;
/// Matched points anywhere that say so too, and how much that counts.
constexpr std::size_t kAnchors = 12;
constexpr float kFar = 0.25f;
/// Cost of a place on the other side of the neighbors.
constexpr float kWrongSide = 0.3f;
/// Nearest neighbors that are asked for the side.
constexpr int kAskedForSide = 5;
/// Points of X farther apart than this do not lie nearer than that on Y.
constexpr float kApartX = 0.12f;
constexpr float kOneOnY = 0.035f;
/// A point is taken out that keeps the distance from less than this part of the
/// others; so many at a time, at most.
constexpr float kLeastKept = 0.7f;
constexpr int kDropRounds = 20;
constexpr std::size_t kLeastMatches = 6;

constexpr int kMostPasses = 14;
/// Passes before OverlapGrowthOptions::distinct_early.
constexpr int kPassesToDistinct = 4;
/// Passes until points with too few matches around them lose their place.
constexpr int kFirstPasses = 3;
/// Results with fewer matches are none.
constexpr std::size_t kLeastResult = 4;
/// Results are one where so much of their matches, and of where those go, is.
constexpr float kSamePlace = 0.12f;
constexpr double kSameResult = 0.6;

/// Tolerances of distances: absolute and relative.
struct Tolerance {
  float base;
  float relative;
  constexpr float Of(float distance) const {
    return base + relative * distance;
  }
};
constexpr Tolerance kPossible = {0.04f, 0.5f};
/// Farther away from a point no neighbor, and no place beside its image, lies.
constexpr float kMostReachX = kFirstReaches * kGrowthReach;
constexpr float kMostReachY = kMostReachX + kPossible.Of(kMostReachX);
constexpr Tolerance kNearDistance = {0.04f, 0.3f};
constexpr Tolerance kFarDistance = {0.06f, 0.2f};
/// Of the final matches.
constexpr Tolerance kKeptDistance = {0.04f, 0.1f};

/// What does not change while seeds grow.
struct Ground {
  const Eigen::MatrixXf& differences;
  const SeedSide& x;
  const SeedSide& y;
  const OverlapGrowthOptions& options;
  std::vector<NearPoints> near_x;  ///< of each point, itself first
  std::vector<NearPoints> near_y;

  int size_x() const { return static_cast<int>(differences.cols()); }
  int size_y() const { return static_cast<int>(differences.rows()); }
  float DistanceX(int a, int b) const { return x.distances(a, b); }
  float DistanceY(int a, int b) const { return y.distances(a, b); }
};

/// One seed as it grows.
class Growth {
 public:
  Growth(const Ground& ground, const Seed& seed)
      : ground_(ground),
        y_of_x_(ground.size_x(), -1),
        costs_(ground.size_x(), kNever),
        pinned_(ground.size_x(), false),
        first_at_(ground.size_y(), -1),
        next_at_(ground.size_x(), -1) {
    for (std::size_t i = 0; i < seed.size(); ++i) {
      Place(seed[i].x, seed[i].y, 0);
      pinned_[seed[i].x] = static_cast<int>(i) < ground.options.pinned;
    }
    least_neighbors_ = std::min<int>(3, static_cast<int>(seed.size()));
  }

  /// Goes on until so many passes are done, or the last one changed little.
  void Run(int passes, const std::stop_token& stop) {
    while (passes_ < passes && !is_settled_ && !stop.stop_requested()) {
      const int changed = Pass(passes_);
      if (passes_ > 0) TakeOutContradicting();
      is_settled_ = changed <= ground_.size_x() / 100;
      ++passes_;
    }
  }

  /// Of neighbors with one place the one stays that fits best.
  void KeepOneEach() {
    std::vector<int> x_of_y(ground_.size_y(), -1);
    for (int x = 0; x < ground_.size_x(); ++x) {
      if (!matched(x)) continue;
      int& other = x_of_y[y_of_x_[x]];
      if (other < 0) {
        other = x;
      } else if (pinned_[other] || costs_[other] <= costs_[x]) {
        TakeOut(x);
      } else {
        TakeOut(std::exchange(other, x));
      }
    }
  }

  /// As it stands, injective after KeepOneEach.
  GrownOverlap Result() const {
    GrownOverlap grown;
    for (int x = 0; x < ground_.size_x(); ++x) {
      if (y_of_x_[x] < 0) continue;
      grown.matches.push_back({x, y_of_x_[x]});
      grown.score += kMostCost - costs_[x];
    }
    const double kept = MeanKeptDistances();
    grown.score *= kept * kept;
    return grown;
  }

 private:
  /// The matched points around one, nearest first.
  struct Neighbors {
    std::array<int, kGrowthNeighbors> points;
    std::array<float, kGrowthNeighbors> weights;  ///< sum 1
    int count = 0;
  };

  bool matched(int x) const { return y_of_x_[x] >= 0; }

  void Place(int x, int y, float cost) {
    if (y != y_of_x_[x]) {
      if (matched(x)) {
        int* at = &first_at_[y_of_x_[x]];
        while (*at != x) at = &next_at_[*at];
        *at = next_at_[x];
      }
      if (y >= 0) next_at_[x] = std::exchange(first_at_[y], x);
    }
    y_of_x_[x] = y;
    costs_[x] = cost;
  }

  void TakeOut(int x) { Place(x, -1, kNever); }

  /// Finds places anew, next to the matches first. Returns how many changed.
  int Pass(int pass) {
    std::vector<int> anchors;
    for (int x = 0; x < ground_.size_x() && anchors.size() < kAnchors; ++x) {
      if (matched(x)) anchors.push_back(x);
    }
    int changed = 0;
    for (const int x : Order(pass)) {
      if (pinned_[x]) continue;
      const Neighbors neighbors =
          NeighborsOf(x, pass == 0 ? kFirstReaches : kNextReaches);
      if (neighbors.count < least_neighbors_) {
        if (matched(x) && pass >= kFirstPasses) {
          TakeOut(x);
          ++changed;
        }
        continue;
      }
      PlaceFound found = BestPlace(x, WitnessesOf(x, neighbors, pass, anchors));
      if (found.y >= 0 && OnWrongSide(x, found.y, neighbors)) {
        found.cost += kWrongSide;
      }
      const bool fits =
          found.y >= 0 && found.cost < kMostCost && IsFree(x, found, &changed);
      const int y = fits ? found.y : -1;
      changed += y != y_of_x_[x];
      Place(x, y, fits ? found.cost : kNever);
    }
    return changed;
  }

  /// The points with a match in reach, by distance from it.
  std::vector<int> Order(int pass) const {
    std::vector<std::pair<float, int>> found;
    // A seed's points lie apart; between them others are placed first.
    const float reach = (pass == 0 ? 1.5f : 1.0f) * kGrowthReach;
    for (int x = 0; x < ground_.size_x(); ++x) {
      const auto& [distances, points] = ground_.near_x[x];
      for (std::size_t i = 0; i < points.size() && distances[i] <= reach; ++i) {
        if (points[i] == x || !matched(points[i])) continue;
        found.emplace_back(distances[i], x);
        break;
      }
    }
    std::sort(found.begin(), found.end());
    std::vector<int> order;
    order.reserve(found.size());
    for (const auto& [distance, x] : found) order.push_back(x);
    return order;
  }

  Neighbors NeighborsOf(int x, float reaches) const {
    Neighbors neighbors;
    float sum = 0;
    const auto& [distances, points] = ground_.near_x[x];
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (neighbors.count == kGrowthNeighbors ||
          distances[i] > reaches * kGrowthReach) {
        break;
      }
      if (points[i] == x || !matched(points[i])) continue;
      neighbors.points[neighbors.count] = points[i];
      neighbors.weights[neighbors.count] = std::exp(-distances[i] / kNearWidth);
      sum += neighbors.weights[neighbors.count++];
    }
    for (int i = 0; i < neighbors.count; ++i) neighbors.weights[i] /= sum;
    return neighbors;
  }

  Witness WitnessOf(int x, int other, Tolerance tolerance, float weight) const {
    const float distance = ground_.DistanceX(x, other);
    const int y = y_of_x_[other];
    return {y, &ground_.y.distances(0, y), distance, 1 / tolerance.Of(distance),
            weight};
  }

  /// What says where a point belongs, nearest neighbor first.
  absl::Span<const Witness> WitnessesOf(int x, const Neighbors& neighbors,
                                        int pass,
                                        const std::vector<int>& anchors) {
    const float far = pass > 0 ? kFar : 0;
    witnesses_.clear();
    for (int i = 0; i < neighbors.count; ++i) {
      witnesses_.push_back(WitnessOf(x, neighbors.points[i], kNearDistance,
                                     (1 - far) * neighbors.weights[i]));
    }
    if (far == 0) return witnesses_;
    const auto left = std::count_if(anchors.begin(), anchors.end(),
                                    [&](int a) { return matched(a); });
    for (const int anchor : anchors) {
      if (!matched(anchor)) continue;  // taken out meanwhile
      witnesses_.push_back(
          WitnessOf(x, anchor, kFarDistance, far / static_cast<float>(left)));
    }
    return witnesses_;
  }

  /// The point of Y at the right distances that looks most alike; none where
  /// all cost too much.
  PlaceFound BestPlace(int x, absl::Span<const Witness> witnesses) const {
    const Witness& nearest = witnesses.front();
    const float tolerance = kPossible.Of(nearest.distance);
    const auto& [distances, points] = ground_.near_y[nearest.y];
    const auto first = std::lower_bound(distances.begin(), distances.end(),
                                        nearest.distance - tolerance);
    const auto last =
        std::upper_bound(first, distances.end(), nearest.distance + tolerance);
    const absl::Span<const int> places =
        absl::MakeSpan(points).subspan(first - distances.begin(), last - first);
    return CheapestPlace(places, &ground_.differences(0, x), kUnlikeness,
                         witnesses, kMostCost);
  }

  /// Whether y lies on the other side of its neighbors' images than x of them.
  bool OnWrongSide(int x, int y, const Neighbors& neighbors) const {
    if (!ground_.options.oriented) return false;
    SidesAround on_x(ground_.x.frames, x);
    SidesAround on_y(ground_.y.frames, y);
    double agreement = 0;
    for (int i = 0; i < std::min(neighbors.count, kAskedForSide); ++i) {
      on_x.Add(neighbors.points[i]);
      on_y.Add(y_of_x_[neighbors.points[i]]);
      for (int j = 0; j < i; ++j) {
        agreement += on_x.Side(j, i) * on_y.Side(j, i);
      }
    }
    return agreement < 0;
  }

  /// Whether no point far from x that fits better lies at the place; those that
  /// fit worse are taken out.
  bool IsFree(int x, const PlaceFound& place, int* changed) {
    const auto& [distances, points] = ground_.near_y[place.y];
    in_the_way_.clear();
    for (std::size_t i = 0; i < points.size() && distances[i] <= kOneOnY; ++i) {
      for (int other = first_at_[points[i]]; other >= 0;
           other = next_at_[other]) {
        if (other == x || ground_.DistanceX(x, other) < kApartX) continue;
        if (pinned_[other] || costs_[other] <= place.cost) return false;
        in_the_way_.push_back(other);
      }
    }
    for (const int other : in_the_way_) TakeOut(other);
    *changed += static_cast<int>(in_the_way_.size());
    return true;
  }

  /// A matched point, and how many others it keeps the distance from, itself
  /// among them.
  struct Kept {
    int x;
    int count;
  };

  void TakeOutContradicting() {
    std::vector<Kept> all = CountKeptDistances(kFarDistance);
    for (int round = 0; round < kDropRounds && all.size() >= kLeastMatches;
         ++round) {
      std::vector<std::pair<float, int>> contradicting;
      for (const auto& [x, count] : all) {
        const float kept =
            static_cast<float>(count) / static_cast<float>(all.size());
        if (kept < kLeastKept && !pinned_[x]) {
          contradicting.emplace_back(kept, x);
        }
      }
      if (contradicting.empty()) return;
      std::sort(contradicting.begin(), contradicting.end());
      const std::size_t most = std::max<std::size_t>(1, all.size() / 12);
      contradicting.resize(std::min(contradicting.size(), most));
      for (const auto& [kept, x] : contradicting) {
        for (Kept& other : all) {
          other.count -= KeepsDistance(x, other.x, kFarDistance);
        }
      }
      for (const auto& [kept, x] : contradicting) TakeOut(x);
      std::erase_if(all, [&](const Kept& one) { return !matched(one.x); });
    }
  }

  bool KeepsDistance(int x, int other, Tolerance tolerance) const {
    const float distance = ground_.DistanceX(x, other);
    return std::abs(distance - ground_.DistanceY(y_of_x_[x], y_of_x_[other])) <
           tolerance.Of(distance);
  }

  std::vector<Kept> CountKeptDistances(Tolerance tolerance) const {
    std::vector<Kept> all;
    for (int x = 0; x < ground_.size_x(); ++x) {
      if (!matched(x)) continue;
      int own = 1;
      for (Kept& other : all) {
        const bool keeps = KeepsDistance(x, other.x, tolerance);
        own += keeps;
        other.count += keeps;
      }
      all.push_back({x, own});
    }
    return all;
  }

  /// What part of the others each keeps the distance from, on average.
  double MeanKeptDistances() const {
    const std::vector<Kept> all = CountKeptDistances(kKeptDistance);
    double sum = 0;
    for (const Kept& one : all) {
      sum += static_cast<float>(one.count) / static_cast<float>(all.size());
    }
    return all.empty() ? 0 : sum / static_cast<double>(all.size());
  }

  const Ground& ground_;
  std::vector<int> y_of_x_;  ///< -1 for none
  std::vector<float> costs_;
  std::vector<char> pinned_;
  /// Points of X at each of Y: the first one, and the one after another.
  std::vector<int> first_at_;
  std::vector<int> next_at_;
  int least_neighbors_ = 3;
  int passes_ = 0;
  bool is_settled_ = false;
  std::vector<int> in_the_way_;
  std::vector<Witness> witnesses_;  ///< of one point
};

/// Whether most points that either matches are matched by both, to one place.
bool AreOne(const GrownOverlap& a, const GrownOverlap& b,
            const Eigen::MatrixXf& distances_y) {
  std::size_t same = 0;
  std::size_t both = 0;
  for (std::size_t i = 0, j = 0;
       i < a.matches.size() && j < b.matches.size();) {
    if (a.matches[i].x != b.matches[j].x) {
      a.matches[i].x < b.matches[j].x ? ++i : ++j;
      continue;
    }
    same += distances_y(a.matches[i++].y, b.matches[j++].y) <= kSamePlace;
    ++both;
  }
  const std::size_t either = a.matches.size() + b.matches.size() - both;
  return static_cast<double>(same) > kSameResult * static_cast<double>(either);
}

/// The best `most` that are distinct from each other, best first.
std::vector<std::size_t> BestDistinct(const std::vector<GrownOverlap>& grown,
                                      const Eigen::MatrixXf& distances_y,
                                      std::size_t most) {
  std::vector<std::size_t> order(grown.size());
  std::iota(order.begin(), order.end(), 0);
  std::ranges::stable_sort(order, std::ranges::greater(),
                           [&](std::size_t i) { return grown[i].score; });
  std::vector<std::size_t> kept;
  for (const std::size_t i : order) {
    if (kept.size() == most) break;
    if (grown[i].matches.size() < kLeastResult) continue;
    if (std::ranges::none_of(kept, [&](std::size_t other) {
          return AreOne(grown[i], grown[other], distances_y);
        })) {
      kept.push_back(i);
    }
  }
  return kept;
}

}  // namespace

absl::StatusOr<std::vector<GrownOverlap>> GrowOverlaps(
    const OverlapGround& ground, const std::vector<Seed>& seeds,
    const OverlapGrowthOptions& options, const std::stop_token& stop) {
  ISOMATCH_ASSIGN_OR_RETURN(
      std::vector<NearPoints> near_x,
      NearPointsOf(ground.x.distances, kMostReachX, stop));
  ISOMATCH_ASSIGN_OR_RETURN(
      std::vector<NearPoints> near_y,
      NearPointsOf(ground.y.distances, kMostReachY, stop));
  const Ground around = {ground.differences, ground.x,
                         ground.y,           options,
                         std::move(near_x),  std::move(near_y)};
  std::vector<Growth> growing;
  growing.reserve(seeds.size());
  for (const Seed& seed : seeds) growing.emplace_back(around, seed);
  std::vector<GrownOverlap> grown(seeds.size());
  std::vector<std::size_t> going_on(seeds.size());
  std::iota(going_on.begin(), going_on.end(), 0);
  const auto run = [&](std::int64_t i, int passes) {
    Growth& one = growing[going_on[i]];
    one.Run(passes, stop);
    if (passes == kMostPasses) one.KeepOneEach();
    grown[going_on[i]] = one.Result();
  };
  const Eigen::MatrixXf& distances_y = ground.y.distances;
  if (options.distinct_early) {
    ISOMATCH_RETURN_IF_ERROR(
        ParallelFor(std::ssize(going_on), stop,
                    [&](std::int64_t i) { run(i, kPassesToDistinct); }));
    going_on = BestDistinct(grown, distances_y, grown.size());
    grown.assign(seeds.size(), {});  // the others have no result
  }
  ISOMATCH_RETURN_IF_ERROR(
      ParallelFor(std::ssize(going_on), stop,
                  [&](std::int64_t i) { run(i, kMostPasses); }));
  ISOMATCH_RETURN_IF_ERROR(CheckNotCancelled(stop));
  const std::vector<std::size_t> chosen =
      BestDistinct(grown, distances_y, options.max_results);
  std::vector<GrownOverlap> best;
  best.reserve(chosen.size());
  for (const std::size_t i : chosen) best.push_back(std::move(grown[i]));
  return best;
}

}  // namespace isomatch
