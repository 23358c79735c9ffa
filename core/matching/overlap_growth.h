#pragma once

#include <stop_token>
#include <vector>

#include <Eigen/Core>

#include "absl/status/statusor.h"
#include "core/matching/alike_seeds.h"
#include "core/matching/seed_generator.h"

namespace isomatch {

struct OverlapGrowthOptions {
  /// Whether the side on which points lie can be compared.
  bool oriented = true;
  /// The first so many matches of every seed stay as they are.
  int pinned = 0;
  /// Of seeds that have become one after some passes only the best grows on:
  /// where most become one, a third of the time, and now and then a worse one
  /// of two that are hard to tell apart.
  bool distinct_early = false;
  /// At most this many results come back, distinct from each other.
  int max_results = 4;
};

/// Points of two pools. References must outlive it.
struct OverlapGround {
  /// P_Y x P_X, small for points that look alike.
  const Eigen::MatrixXf& differences;
  SeedSide x;
  SeedSide y;
};

/// Points of X that have a counterpart on Y, as far as a seed has grown.
struct GrownOverlap {
  std::vector<PointMatch> matches;  ///< injective, by point of X
  /// How well they fit, summed, times the square of the part of all distances
  /// that they keep: larger is better.
  double score = 0;
};

/// Grows each seed over all points of X that have a counterpart where their
/// neighbors' counterparts say it must lie; the others stay out. A point goes
/// to the point of Y at the same distances from the images of its matched
/// neighbors, and of some points far away, that looks most like it; unless that
/// fits badly, lies on the other side, or is taken by a point that fits better.
/// Points whose distances from most others are not kept are taken out again.
///
/// Lengths in sqrt(area of Y). Returns the distinct results, best first; none
/// where nothing grows. Not in the paper. Deterministic at any thread count.
/// CANCELLED after `stop`. Time O(seeds P_X P_Y).
absl::StatusOr<std::vector<GrownOverlap>> GrowOverlaps(
    const OverlapGround& ground, const std::vector<Seed>& seeds,
    const OverlapGrowthOptions& options, const std::stop_token& stop);

}  // namespace isomatch
