#include <cstdio>

#include "core/base/status_macros.h"
#include "tests/bench/accuracy.h"
#include "tests/bench/run_pairs.h"

namespace isomatch::bench {
namespace {

struct Row {
  const char* name;
  Swapping swapping;
};
constexpr Row kRows[] = {{"no swapping", Swapping::kNone},
                         {"greedy", Swapping::kGreedy},
                         {"annealed", Swapping::kAnnealed}};

/// Mean error of the map just before ZoomOut or the elastic alignment, or of
/// the final one.
StageError BeforeRefinement(const std::vector<StageError>& stages) {
  StageError before = stages.back();
  for (const StageError& stage : stages) {
    if (stage.stage >= Stage::kZoomOut) break;
    before = stage;
  }
  return before;
}

}  // namespace

absl::Status RunAblation(const PairSelection& pairs,
                         const MatchOptions& options) {
  std::printf(
      "%s profile, mean error / diameter over the pairs, direct (best "
      "of truth and mirrored truth)\n",
      ProfileName(options.profile));
  std::printf("%-14s %-18s %-18s %-18s %s\n", "", "first stage",
              "w/o refinement", "refined", "mirrored, failed");
  for (const Row& row : kRows) {
    MatchOptions variant = options;
    variant.swapping = row.swapping;
    ISOMATCH_ASSIGN_OR_RETURN(
        const std::vector<PairResult> results,
        RunPairs(pairs, variant, [](const PairResult&) {}));
    const std::vector<StageError> stages = StageMeans(results);
    const StageError before = BeforeRefinement(stages);
    const Summary summary = Summarize(results);
    std::printf("%-14s %.4f (%.4f)    %.4f (%.4f)    %.4f (%.4f)    %d, %d\n",
                row.name, stages.front().direct, stages.front().best,
                before.direct, before.best, stages.back().direct,
                stages.back().best, summary.mirrored, summary.failed);
    std::fflush(stdout);
  }
  return absl::OkStatus();
}

}  // namespace isomatch::bench
