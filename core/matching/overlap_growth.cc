#include "core/matching/overlap_growth.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <utility>

#include "core/base/parallel.h"
#include "core/base/status_macros.h"
#include "core/matching/orientation.h"

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
/// Points near which neighbors are looked for.
constexpr std::size_t kNearestPoints = 400;
/// Matched points anywhere that say so too, and how much that counts.
constexpr std::size_t kAnchors = 12;
constexpr float kFar = 0.25f;
/// Cost of a place on the other side of the neighbors.
constexpr float kWrongSide = 0.3f;
/// Points of X farther apart than this do not lie nearer than that on Y.
constexpr float kApartX = 0.12f;
constexpr float kOneOnY = 0.035f;
/// A point is taken out that keeps the distance from less than this part of the
/// others; so many at a time, at most.
constexpr float kLeastKept = 0.7f;
constexpr int kDropRounds = 20;
constexpr std::size_t kLeastMatches = 6;

constexpr int kMostPasses = 14;
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
  float Of(float distance) const { return base + relative * distance; }
};
constexpr Tolerance kPossible = {0.04f, 0.5f};
constexpr Tolerance kNearDistance = {0.04f, 0.3f};
constexpr Tolerance kFarDistance = {0.06f, 0.2f};
/// Of the final matches.
constexpr Tolerance kKeptDistance = {0.04f, 0.1f};

float Misfit(float on_x, float on_y, Tolerance tolerance) {
  return std::min(1.0f, std::abs(on_x - on_y) / tolerance.Of(on_x));
}

/// What does not change while seeds grow.
struct Ground {
  const Eigen::MatrixXf& differences;
  const SeedSide& x;
  const SeedSide& y;
  const OverlapGrowthOptions& options;
  std::vector<std::vector<int>> nearest_x;  ///< of each point, itself first

  int size_x() const { return static_cast<int>(differences.cols()); }
  int size_y() const { return static_cast<int>(differences.rows()); }
  float DistanceX(int a, int b) const { return x.distances(a, b); }
  float DistanceY(int a, int b) const { return y.distances(a, b); }
};

std::vector<std::vector<int>> NearestPoints(const Eigen::MatrixXf& distances) {
  std::vector<std::vector<int>> nearest(distances.cols());
  for (Eigen::Index p = 0; p < distances.cols(); ++p) {
    std::vector<int>& order = nearest[p];
    order.resize(distances.cols());
    std::iota(order.begin(), order.end(), 0);
    const std::size_t count = std::min(kNearestPoints, order.size());
    std::partial_sort(
        order.begin(), order.begin() + count, order.end(), [&](int a, int b) {
          return std::pair(distances(a, p), a) < std::pair(distances(b, p), b);
        });
    order.resize(count);
  }
  return nearest;
}

/// One seed as it grows.
class Growth {
 public:
  Growth(const Ground& ground, const Seed& seed)
      : ground_(ground),
        y_of_x_(ground.size_x(), -1),
        costs_(ground.size_x(), kNever),
        pinned_(ground.size_x(), false) {
    for (std::size_t i = 0; i < seed.size(); ++i) {
      Place(seed[i].x, seed[i].y, 0);
      pinned_[seed[i].x] = static_cast<int>(i) < ground.options.pinned;
    }
    least_neighbors_ = std::min<int>(3, static_cast<int>(seed.size()));
  }

  GrownOverlap Run(const std::stop_token& stop) {
    for (int pass = 0; pass < kMostPasses && !stop.stop_requested(); ++pass) {
      const int changed = Pass(pass);
      if (pass > 0) TakeOutContradicting();
      if (changed <= ground_.size_x() / 100) break;
    }
    KeepOneEach();
    GrownOverlap grown;
    for (int x = 0; x < ground_.size_x(); ++x) {
      if (y_of_x_[x] < 0) continue;
      grown.matches.push_back({x, y_of_x_[x]});
      grown.score += kMostCost - costs_[x];
    }
    const double kept = MeanKeptDistances(grown.matches);
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

  struct PlaceFound {
    int y = -1;
    float cost = kNever;
  };

  bool matched(int x) const { return y_of_x_[x] >= 0; }

  void Place(int x, int y, float cost) {
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
      const Neighbors neighbors = NeighborsOf(x, pass == 0 ? 4 : 1.5f);
      if (neighbors.count < least_neighbors_) {
        if (matched(x) && pass >= kFirstPasses) {
          TakeOut(x);
          ++changed;
        }
        continue;
      }
      PlaceFound found = BestPlace(x, neighbors, pass, anchors);
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
      for (const int other : ground_.nearest_x[x]) {
        const float distance = ground_.DistanceX(x, other);
        if (distance > reach) break;
        if (other == x || !matched(other)) continue;
        found.emplace_back(distance, x);
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
    for (const int other : ground_.nearest_x[x]) {
      const float distance = ground_.DistanceX(x, other);
      if (neighbors.count == kGrowthNeighbors ||
          distance > reaches * kGrowthReach)
        break;
      if (other == x || !matched(other)) continue;
      neighbors.points[neighbors.count] = other;
      neighbors.weights[neighbors.count] = std::exp(-distance / kNearWidth);
      sum += neighbors.weights[neighbors.count++];
    }
    for (int i = 0; i < neighbors.count; ++i) neighbors.weights[i] /= sum;
    return neighbors;
  }

  /// The point of Y at the right distances that looks most alike.
  PlaceFound BestPlace(int x, const Neighbors& neighbors, int pass,
                       const std::vector<int>& anchors) const {
    const float far = pass > 0 ? kFar : 0;
    PlaceFound best;
    const int first = neighbors.points[0];
    const float wanted = ground_.DistanceX(x, first);
    const float tolerance = kPossible.Of(wanted);
    const auto from_first = ground_.y.distances.col(y_of_x_[first]);
    for (int y = 0; y < ground_.size_y(); ++y) {
      if (std::abs(wanted - from_first[y]) > tolerance) continue;
      float cost = kUnlikeness * ground_.differences(y, x);
      for (int i = 0; i < neighbors.count && cost < best.cost; ++i) {
        const int other = neighbors.points[i];
        cost += (1 - far) * neighbors.weights[i] *
                Misfit(ground_.DistanceX(x, other),
                       ground_.DistanceY(y, y_of_x_[other]), kNearDistance);
      }
      if (far > 0) cost += far * AnchorMisfit(x, y, anchors);
      if (cost < best.cost) best = {y, cost};
    }
    return best;
  }

  float AnchorMisfit(int x, int y, const std::vector<int>& anchors) const {
    float sum = 0;
    int count = 0;
    for (const int anchor : anchors) {
      if (!matched(anchor)) continue;  // taken out meanwhile
      sum += Misfit(ground_.DistanceX(x, anchor),
                    ground_.DistanceY(y, y_of_x_[anchor]), kFarDistance);
      ++count;
    }
    return count > 0 ? sum / static_cast<float>(count) : 0;
  }

  /// Whether y lies on the other side of its neighbors' images than x of them.
  bool OnWrongSide(int x, int y, const Neighbors& neighbors) const {
    if (!ground_.options.oriented) return false;
    double agreement = 0;
    const int count = std::min(neighbors.count, 5);
    for (int i = 0; i < std::min(count, 4); ++i) {
      for (int j = i + 1; j < count; ++j) {
        const int a = neighbors.points[i];
        const int b = neighbors.points[j];
        agreement += SideAround(ground_.x.frames, x, a, b) *
                     SideAround(ground_.y.frames, y, y_of_x_[a], y_of_x_[b]);
      }
    }
    return agreement < 0;
  }

  /// Whether no point far from x that fits better lies at the place; those that
  /// fit worse are taken out.
  bool IsFree(int x, const PlaceFound& place, int* changed) {
    for (int other = 0; other < ground_.size_x(); ++other) {
      if (other == x || !matched(other) ||
          ground_.DistanceX(x, other) < kApartX ||
          ground_.DistanceY(place.y, y_of_x_[other]) > kOneOnY) {
        continue;
      }
      if (pinned_[other] || costs_[other] <= place.cost) return false;
      TakeOut(other);
      ++*changed;
    }
    return true;
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

  void TakeOutContradicting() {
    for (int round = 0; round < kDropRounds; ++round) {
      std::vector<int> all;
      for (int x = 0; x < ground_.size_x(); ++x) {
        if (matched(x)) all.push_back(x);
      }
      if (all.size() < kLeastMatches) return;
      std::vector<std::pair<float, int>> contradicting;
      for (const int x : all) {
        const float kept = KeptDistances(x, all, kFarDistance);
        if (kept < kLeastKept && !pinned_[x])
          contradicting.emplace_back(kept, x);
      }
      if (contradicting.empty()) return;
      std::sort(contradicting.begin(), contradicting.end());
      const std::size_t most = std::max<std::size_t>(1, all.size() / 12);
      contradicting.resize(std::min(contradicting.size(), most));
      for (const auto& [kept, x] : contradicting) TakeOut(x);
    }
  }

  /// From what part of the others a point keeps its distance.
  float KeptDistances(int x, const std::vector<int>& others,
                      Tolerance tolerance) const {
    int kept = 0;
    for (const int other : others) {
      const float distance = ground_.DistanceX(x, other);
      kept +=
          std::abs(distance - ground_.DistanceY(y_of_x_[x], y_of_x_[other])) <
          tolerance.Of(distance);
    }
    return static_cast<float>(kept) / static_cast<float>(others.size());
  }

  double MeanKeptDistances(const std::vector<PointMatch>& matches) const {
    std::vector<int> all;
    all.reserve(matches.size());
    for (const PointMatch& match : matches) all.push_back(match.x);
    double sum = 0;
    for (const int x : all) sum += KeptDistances(x, all, kKeptDistance);
    return all.empty() ? 0 : sum / static_cast<double>(all.size());
  }

  const Ground& ground_;
  std::vector<int> y_of_x_;  ///< -1 for none
  std::vector<float> costs_;
  std::vector<char> pinned_;
  int least_neighbors_;
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

std::vector<GrownOverlap> BestDistinct(std::vector<GrownOverlap> grown,
                                       const Eigen::MatrixXf& distances_y,
                                       int max_results) {
  std::stable_sort(grown.begin(), grown.end(),
                   [](const GrownOverlap& a, const GrownOverlap& b) {
                     return a.score > b.score;
                   });
  std::vector<GrownOverlap> kept;
  for (GrownOverlap& one : grown) {
    if (static_cast<int>(kept.size()) == max_results) break;
    if (one.matches.size() < kLeastResult) continue;
    if (std::none_of(kept.begin(), kept.end(), [&](const GrownOverlap& other) {
          return AreOne(one, other, distances_y);
        })) {
      kept.push_back(std::move(one));
    }
  }
  return kept;
}

}  // namespace

absl::StatusOr<std::vector<GrownOverlap>> GrowOverlaps(
    const OverlapGround& ground, const std::vector<Seed>& seeds,
    const OverlapGrowthOptions& options, const std::stop_token& stop) {
  const Ground around = {ground.differences, ground.x, ground.y, options,
                         NearestPoints(ground.x.distances)};
  std::vector<GrownOverlap> grown(seeds.size());
  ISOMATCH_RETURN_IF_ERROR(ParallelFor(
      static_cast<std::int64_t>(seeds.size()), stop,
      [&](std::int64_t i) { grown[i] = Growth(around, seeds[i]).Run(stop); }));
  ISOMATCH_RETURN_IF_ERROR(CheckNotCancelled(stop));
  return BestDistinct(std::move(grown), ground.y.distances,
                      options.max_results);
}

}  // namespace isomatch
