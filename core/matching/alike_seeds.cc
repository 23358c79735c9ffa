#include "core/matching/alike_seeds.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "core/base/parallel.h"
#include "core/base/random_stream.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

/// Triples whose points lie nearer or farther than this are not tried, in
/// sqrt(area): they say little, or what others say as well.
constexpr float kNearest = 0.08f;
constexpr float kFarthest = 0.8f;
/// Two distances agree when they differ by no more than kTolerance times
/// (kShort + the smaller one).
constexpr float kTolerance = 0.1f;
constexpr float kShort = 0.3f;
/// Product of sines below which two points lie on another side.
constexpr double kOtherSide = -0.05;
/// Distances count less the longer they are.
constexpr float kSupportWidth = 0.25f;
/// Sum over a triple of the differences of exp(-d / kSupportWidth) from which a
/// point does not support it.
constexpr float kNoSupport = 0.25f;
/// Seeds before one that it is compared with.
constexpr std::size_t kCompared = 300;
/// Triples by which the support of all is told.
constexpr std::size_t kBest = 100;
/// Random streams that share the tries.
constexpr int kStreams = 64;

/// A triple and how well it is supported.
struct RankedTriple {
  std::array<PointMatch, 3> matches;
  float support = -1;
};

bool Agree(float a, float b) {
  return std::abs(a - b) <= kTolerance * (kShort + std::min(a, b));
}

class TripleSearch {
 public:
  TripleSearch(const Eigen::MatrixXf& differences, const SeedSide& x,
               const SeedSide& y, const AlikeSeedOptions& options)
      : differences_(differences),
        x_(x),
        y_(y),
        options_(options),
        points_x_(std::min<int>(options.points_x, differences.cols())),
        nearness_x_((-x.distances / kSupportWidth).array().exp()),
        nearness_y_((-y.distances / kSupportWidth).array().exp()) {
    partners_.resize(points_x_);
  }

  /// The first thing to call.
  absl::Status FindPartners(const std::stop_token& stop) {
    const auto count = std::min<int>(options_.partners, differences_.rows());
    return ParallelFor(points_x_, stop, [&](std::int64_t x) {
      std::vector<int> order(differences_.rows());
      std::iota(order.begin(), order.end(), 0);
      std::partial_sort(order.begin(), order.begin() + count, order.end(),
                        [&](int a, int b) {
                          return std::pair(differences_(a, x), a) <
                                 std::pair(differences_(b, x), b);
                        });
      partners_[x] = {order.begin(), order.begin() + count};
    });
  }

  /// One random triple with its best partners; no support where it has none.
  RankedTriple Try(RandomStream* random) const {
    const std::array<int, 3> xs = {random->Below(points_x_),
                                   random->Below(points_x_),
                                   random->Below(points_x_)};
    RankedTriple triple;
    if (xs[0] == xs[1] || xs[1] == xs[2] || xs[0] == xs[2]) return triple;
    for (int i = 0; i < 3; ++i) {
      const float distance = x_.distances(xs[i], xs[(i + 1) % 3]);
      if (distance < kNearest || distance > kFarthest) return triple;
    }
    const std::array<int, 3> ys = BestPartners(xs);
    if (ys[0] < 0) return triple;
    for (int i = 0; i < 3; ++i) triple.matches[i] = {xs[i], ys[i]};
    triple.support = Support(triple.matches);
    return triple;
  }

 private:
  bool AgreeInDistance(const std::array<int, 3>& xs,
                       const std::array<int, 3>& ys, int i, int j) const {
    return Agree(x_.distances(xs[i], xs[j]), y_.distances(ys[i], ys[j]));
  }

  bool AgreeInSide(const std::array<int, 3>& xs,
                   const std::array<int, 3>& ys) const {
    if (!options_.oriented) return true;
    return SideAround(x_.frames, xs[0], xs[1], xs[2]) *
               SideAround(y_.frames, ys[0], ys[1], ys[2]) >=
           kOtherSide;
  }

  /// Partners of a triple's points.
  struct Partners {
    std::array<int, 3> ys = {-1, -1, -1};
    float difference = std::numeric_limits<float>::infinity();
  };

  /// Takes the third partner beside `ys` that agrees in distances and side, if
  /// the three look more alike than the best.
  void AddThird(const std::array<int, 3>& xs, std::array<int, 3> ys,
                Partners* best) const {
    const float of_two =
        differences_(ys[0], xs[0]) + differences_(ys[1], xs[1]);
    for (const int y : partners_[xs[2]]) {
      const float difference = of_two + differences_(y, xs[2]);
      if (difference >= best->difference || y == ys[0] || y == ys[1]) continue;
      ys[2] = y;
      if (!AgreeInDistance(xs, ys, 1, 2) || !AgreeInDistance(xs, ys, 0, 2) ||
          !AgreeInSide(xs, ys)) {
        continue;
      }
      *best = {ys, difference};
    }
  }

  /// The partners that agree in distances and side and look most alike; -1 for
  /// none.
  std::array<int, 3> BestPartners(const std::array<int, 3>& xs) const {
    Partners best;
    for (const int a : partners_[xs[0]]) {
      for (const int b : partners_[xs[1]]) {
        if (a == b || !AgreeInDistance(xs, {a, b, -1}, 0, 1)) continue;
        AddThird(xs, {a, b, -1}, &best);
      }
    }
    return best.ys;
  }

  /// How many points have a partner at the distances that the triple asks for,
  /// near ones counting more.
  float Support(const std::array<PointMatch, 3>& triple) const {
    const auto& [a, b, c] = triple;
    float support = 0;
    for (int x = 0; x < points_x_; ++x) {
      const Eigen::Array3f wanted(nearness_x_(x, a.x), nearness_x_(x, b.x),
                                  nearness_x_(x, c.x));
      float least = kNoSupport;
      for (const int y : partners_[x]) {
        const float error = std::abs(wanted[0] - nearness_y_(y, a.y)) +
                            std::abs(wanted[1] - nearness_y_(y, b.y)) +
                            std::abs(wanted[2] - nearness_y_(y, c.y));
        least = std::min(least, error);
      }
      support += wanted.maxCoeff() * (1 - least / kNoSupport);
    }
    return support;
  }

  const Eigen::MatrixXf& differences_;
  const SeedSide& x_;
  const SeedSide& y_;
  const AlikeSeedOptions& options_;
  const int points_x_;
  const Eigen::ArrayXXf nearness_x_;
  const Eigen::ArrayXXf nearness_y_;
  std::vector<std::vector<int>> partners_;  ///< of each of X's points
};

/// Fills support and ratio from the triples, best first.
void SumUp(const std::vector<RankedTriple>& triples, const SeedSide& x,
           const SeedSide& y, SupportedSeeds* found) {
  std::vector<float> ratios;
  for (std::size_t i = 0; i < std::min(kBest, triples.size()); ++i) {
    if (triples[i].support < 0) break;
    found->support += triples[i].support / double(kBest);
    const auto& matches = triples[i].matches;
    for (int a = 0; a < 3; ++a) {
      const PointMatch& one = matches[a];
      const PointMatch& other = matches[(a + 1) % 3];
      ratios.push_back(y.distances(one.y, other.y) /
                       x.distances(one.x, other.x));
    }
  }
  if (ratios.empty()) return;
  const auto middle = ratios.begin() + ratios.size() / 2;
  std::nth_element(ratios.begin(), middle, ratios.end());
  found->ratio = *middle;
}

bool ShareTwo(const std::array<PointMatch, 3>& triple, const Seed& seed) {
  int same = 0;
  for (const PointMatch& match : triple) {
    same += static_cast<int>(std::count(seed.begin(), seed.end(), match));
  }
  return same >= 2;
}

}  // namespace

absl::StatusOr<SupportedSeeds> AlikeSeeds(const Eigen::MatrixXf& differences,
                                          const SeedSide& x, const SeedSide& y,
                                          const AlikeSeedOptions& options,
                                          const std::stop_token& stop) {
  TripleSearch search(differences, x, y, options);
  ISOMATCH_RETURN_IF_ERROR(search.FindPartners(stop));
  std::vector<RankedTriple> triples(options.tries);
  ISOMATCH_RETURN_IF_ERROR(ParallelFor(kStreams, stop, [&](std::int64_t i) {
    RandomStream random(options.random_seed, i);
    for (int t = static_cast<int>(i); t < options.tries; t += kStreams) {
      triples[t] = search.Try(&random);
    }
  }));
  std::stable_sort(triples.begin(), triples.end(),
                   [](const RankedTriple& a, const RankedTriple& b) {
                     return a.support > b.support;
                   });
  SupportedSeeds found;
  SumUp(triples, x, y, &found);
  std::vector<Seed>& seeds = found.seeds;
  for (const RankedTriple& triple : triples) {
    if (triple.support < 0 ||
        seeds.size() == static_cast<std::size_t>(options.max_seeds)) {
      break;
    }
    const auto first = seeds.end() - std::min(seeds.size(), kCompared);
    if (std::none_of(first, seeds.end(), [&](const Seed& seed) {
          return ShareTwo(triple.matches, seed);
        })) {
      seeds.emplace_back(triple.matches.begin(), triple.matches.end());
    }
  }
  return found;
}

}  // namespace isomatch
