#pragma once

#include <cstdint>
#include <stop_token>
#include <vector>

#include <Eigen/Core>

#include "absl/status/statusor.h"
#include "core/matching/orientation.h"
#include "core/matching/seed_generator.h"

namespace isomatch {

/// Points of a pool as alike seeds need them. References must outlive it.
struct SeedSide {
  /// P x P geodesic distances, mesh units, the same on both shapes.
  const Eigen::MatrixXf& distances;
  const PointFrames& frames;
};

struct AlikeSeedOptions {
  /// Seeds that come back.
  int max_seeds = 300;
  /// The first so many points of X's pool make seeds.
  int points_x = 200;
  /// Partners on Y that each of them may have: those most like it.
  int partners = 8;
  /// Triples that are tried.
  int tries = 40000;
  /// Whether the side on which points lie can be compared.
  bool oriented = true;
  std::uint64_t random_seed = 1;
};

/// Seeds, and how many points of X support the best ones: the mean of the
/// hundred best. It is largest where both shapes have one unit.
struct SupportedSeeds {
  std::vector<Seed> seeds;
  double support = 0;
  /// Median ratio of Y's distances to X's among those.
  double ratio = 1;
};

/// Returns seeds of three matches between points that look alike: random
/// triples of points of X with those of their partners on Y that agree in
/// distances and side, ranked by how many other points of X then have a partner
/// at the same distances. Unlike GenerateSeeds they need no extremities and no
/// equal areas, so that X may be a part of Y. No two have two matches in
/// common.
///
/// `differences`: P_Y x P_X, small for points that look alike. Deterministic at
/// any thread count. CANCELLED after `stop`. Not in the paper.
absl::StatusOr<SupportedSeeds> AlikeSeeds(const Eigen::MatrixXf& differences,
                                          const SeedSide& x, const SeedSide& y,
                                          const AlikeSeedOptions& options,
                                          const std::stop_token& stop);

}  // namespace isomatch
