#include <algorithm>
#include <cstdio>

#include "core/base/status_macros.h"
#include "tests/bench/accuracy.h"
#include "tests/bench/run_pairs.h"

namespace isomatch::bench {

absl::Status RunDeadlines(const PairSelection& pairs,
                          const std::vector<double>& deadlines,
                          const MatchOptions& options) {
  std::printf("%-10s %-10s %-10s %-10s %s\n", "deadline", "seconds", "error",
              "median", "failed, ended early, of pairs");
  for (const double deadline : deadlines) {
    PairSelection selection = pairs;
    selection.deadline = deadline;
    ISOMATCH_ASSIGN_OR_RETURN(
        const std::vector<PairResult> results,
        RunPairs(selection, options, [](const PairResult&) {}));
    const Summary summary = Summarize(results);
    const auto early =
        std::ranges::count(results, true, &PairResult::ended_early);
    std::printf("%-10g %-10.3f %-10.4f %-10.4f %d, %d, %d\n", deadline,
                summary.seconds_mean, summary.direct_mean,
                summary.direct_median, summary.failed, static_cast<int>(early),
                static_cast<int>(results.size()));
    std::fflush(stdout);
  }
  return absl::OkStatus();
}

}  // namespace isomatch::bench
