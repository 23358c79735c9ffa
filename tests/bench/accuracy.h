#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "core/pipeline/match_options.h"
#include "tests/bench/run_pairs.h"

namespace isomatch::bench {

/// Matches every pair of a set and prints errors / diameter by pair, by stage
/// and in total; the same as JSON to `out_path` unless that is empty. Where a
/// map or a truth leaves vertices of X out, the IoU of the overlap, too.
absl::Status RunAccuracy(const PairSelection& pairs,
                         const MatchOptions& options,
                         const std::string& out_path);

/// Matches every pair of a set with each deadline, in seconds, and prints what
/// errors and times the maps have that are there then.
absl::Status RunDeadlines(const PairSelection& pairs,
                          const std::vector<double>& deadlines,
                          const MatchOptions& options);

/// The paper's Table 1: swapping none, greedy and annealed, without and with
/// ZoomOut (default: the elastic alignment). "Without" is the map just before
/// it.
absl::Status RunAblation(const PairSelection& pairs,
                         const MatchOptions& options);

}  // namespace isomatch::bench
