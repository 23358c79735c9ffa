#pragma once

#include <cstdint>
#include <functional>
#include <stop_token>
#include <vector>

#include "absl/status/statusor.h"
#include "core/matching/annealing.h"
#include "core/matching/insertion.h"
#include "core/matching/matching.h"
#include "core/matching/orientation.h"
#include "core/matching/seed_generator.h"

namespace isomatch {

/// How two matches are proposed to exchange their images (paper, 3.4 and Table
/// 1).
enum class Swapping {
  kNone,
  /// Only what lowers the energy: temperature 0 throughout.
  kGreedy,
  /// Simulated annealing, then frozen at temperature 0.
  kAnnealed,
};

/// What ranks competing partial maps.
enum class Selection {
  /// Eq. 4, as the paper has it; larger is better.
  kObjective,
  /// Mean Eq. 8 residual; smaller is better.
  kEmbeddingError,
};

/// One round in which competing partial maps are grown to `matches` matches
/// and the best `keep` go on.
struct SelectionRound {
  int matches;
  int keep;
};

struct FirstStageOptions {
  /// Matches of the result, if the pools have as many points.
  int matches = 250;
  /// Earlier rounds, by increasing `matches`.
  std::vector<SelectionRound> rounds;
  Selection selection = Selection::kEmbeddingError;
  /// Maps with a negative orientation score rank last from this many matches
  /// on; 0 for never.
  int orientation_from = 0;
  /// Complete maps rank by their embedding error times this power of their
  /// curvature mismatch; 0 leaves curvature out. With
  /// Selection::kEmbeddingError only.
  double curvature_weight = 0;
  Swapping swapping = Swapping::kAnnealed;
  /// Insertions between two swap phases.
  int swap_interval = 10;
  SwapOptions swaps;
  double temperature = 0.01;
  /// RelocationSweep after each swap phase; 0 for none.
  int relocation_neighbors = 0;
  /// Where maps send points is told by this many first points of Y's pool, 0
  /// for all: enough when those are farthest points.
  int places = 0;
  /// At most this many maps come back, distinct from each other.
  int max_results = 1;
  /// Complete maps that keep orientation have their mirrored regions taken out
  /// and grown anew from the rim.
  bool regrow_mirrored = false;
  /// Known matches. Maps that contradict a larger part of them rank lower; and
  /// where they speak for the mirror image, unmirrored maps come last instead.
  std::vector<PointMatch> landmarks;
  /// Insertion samples points of X alone, where Y may have points that X has no
  /// counterpart of.
  bool insert_from_x_only = false;
  /// The first so many matches of every seed stay as they are.
  int pinned = 0;
  std::uint64_t random_seed = 1;
};

/// What the first stage works on: one entry a side. References must outlive
/// the call.
struct FirstStageInput {
  const PointPool& pool_x;
  const PointPool& pool_y;
  const CandidateSearch& search_x;
  const CandidateSearch& search_y;
  const PointFrames& frames_x;
  const PointFrames& frames_y;
  /// nullptr for none.
  const PointCosts* costs = nullptr;
};

/// A map of the first stage and what it was ranked by.
struct RankedMap {
  Matching matching;
  /// Fraction of FirstStageOptions::landmarks that it sends elsewhere.
  double contradiction = 0;
  /// Embedding error, times the curvature mismatch to its power, times the
  /// penalty of landmarks; smaller is better. The negative objective with
  /// Selection::kObjective.
  double badness = 0;
  /// Mirrored; or not mirrored, where the landmarks want it so.
  bool wrong_side = false;
};

/// How much worse landmarks make a map of which they contradict this fraction,
/// as a factor; above 1.
double LandmarkPenalty(double contradicted_fraction);

/// The first stage (paper, Section 3.2): grows every seed, in rounds after each
/// of which only the best go on, freezes those that reach the full size at
/// temperature 0, and returns the best.
///
/// Each seed has its own random stream, so the result does not depend on the
/// number of threads. `progress`, when set, is called with a fraction in
/// (0, 1], from one thread at a time.
///
/// REQUIRES: at least one seed, all injective. CANCELLED after `stop`.
/// Time O(seeds matches^2 P) in the worst case; memory as a Matching for each
/// thread.
absl::StatusOr<std::vector<RankedMap>> RunFirstStage(
    const FirstStageInput& input, const std::vector<Seed>& seeds,
    const FirstStageOptions& options,
    const std::function<void(double)>& progress, const std::stop_token& stop);

}  // namespace isomatch
