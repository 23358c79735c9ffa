#include "core/pipeline/torn_maps.h"

#include <utility>

#include "core/base/status_macros.h"

namespace isomatch {
namespace {

// Measured on right and wrong maps: core/EXPERIMENTS.md, "Torn maps".
constexpr double kTornStretch = 0.09;
constexpr double kTornNormals = 0.03;
constexpr int kMoreTries = 2;

}  // namespace

bool IsTorn(const MapScores& scores) {
  return scores.stretch > kTornStretch && scores.normal_mismatch > kTornNormals;
}

absl::StatusOr<Correspondence> MatchUntilNotTorn(
    const MatchOptions& options, const StopTokens& stops,
    absl::FunctionRef<absl::StatusOr<Correspondence>(
        const MatchOptions& options, const StopTokens& stops)>
        match) {
  ISOMATCH_ASSIGN_OR_RETURN(Correspondence best, match(options, stops));
  MatchOptions next = options;
  for (int i = 0; i < kMoreTries && IsTorn(best.scores); ++i) {
    const bool is_mirrored = best.scores.orientation_score < 0;
    if (is_mirrored || stops.hurry.stop_requested()) break;
    ++next.random_seed;
    const EitherStop ends(stops);
    absl::StatusOr<Correspondence> other = match(next, {ends.token(), {}});
    if (other.ok()) {
      if (other->scores.rank_value < best.scores.rank_value) {
        best = *std::move(other);
      }
    } else if (stops.stop.stop_requested()) {
      return other.status();
    }
  }
  return best;
}

}  // namespace isomatch
