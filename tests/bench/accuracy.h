#pragma once

#include <string>

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

/// The paper's Table 1: swapping none, greedy and annealed, without and with
/// ZoomOut (default: the elastic alignment). "Without" is the map just before
/// it.
absl::Status RunAblation(const PairSelection& pairs,
                         const MatchOptions& options);

}  // namespace isomatch::bench
