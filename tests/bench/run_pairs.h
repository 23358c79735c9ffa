#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/pipeline/match_options.h"
#include "core/pipeline/progress.h"
#include "core/pipeline/verdict.h"
#include "tests/bench/pair_set.h"

namespace isomatch::bench {

/// A map with a larger mean direct error / diameter has failed. One that
/// matches no vertex that has a counterpart has an error of 1.
inline constexpr double kFailed = 0.1;

/// Mean errors / diameter of the map after one stage. `best` is the better of
/// direct and mirrored truth for the whole map.
struct StageError {
  Stage stage;
  double direct = 0;
  double best = 0;
};

/// Confidence and direct error / diameter of one vertex.
struct RatedVertex {
  float confidence;
  float error;
};

/// What one pair gave.
struct PairResult {
  std::string name_x;
  std::string name_y;
  int vertices_x = 0;
  int vertices_y = 0;
  std::vector<StageError> stages;  ///< the last is the final map
  double seconds = 0;
  double embedding_error = 0;
  double orientation_score = 0;
  double symmetry_confidence = 0;
  Verdict verdict;
  Relation relation = Relation::kWhole;
  double relation_confidence = 1;
  double mean_confidence = 0;
  double rank_value = 0;
  double scale = 1;
  bool ended_early = false;
  std::vector<RatedVertex> rated;  ///< vertices with a truth and an image
  /// Of the part of X that has a counterpart, as OverlapIou, by area.
  std::optional<double> iou = {};

  double direct() const { return stages.back().direct; }
  double best() const { return stages.back().best; }
  bool mirrored() const { return best() < direct(); }
  bool failed() const { return direct() > kFailed; }
};

/// Which pairs, and how.
struct PairSelection {
  std::string dir;
  std::string list;        ///< of pairs; empty: dir/pairs.txt
  std::string filter;      ///< only pairs whose names contain this
  int true_landmarks = 0;  ///< matches of its truth that each pair is given
  /// Meshes go through Draco first, as those that clients send.
  bool as_sent = false;
  /// Seconds after which a match ends with the best map it has; 0 for never.
  double deadline = 0;
};

/// Matches the pairs and calls `done` after each.
absl::StatusOr<std::vector<PairResult>> RunPairs(
    const PairSelection& pairs, const MatchOptions& options,
    const std::function<void(const PairResult&)>& done);

/// Means over pairs, and medians.
struct Summary {
  double direct_mean = 0;
  double direct_median = 0;
  double best_mean = 0;
  double best_median = 0;
  int mirrored = 0;
  int failed = 0;
  double seconds_mean = 0;
  /// Not set when no pair has one; pairs without count as 1.
  std::optional<double> iou_mean = {};
  double iou_median = 1;
};
Summary Summarize(const std::vector<PairResult>& results);

/// How well confidence ranks the errors of all vertices of all pairs.
struct ConfidenceCurve {
  static constexpr double kFractions[] = {.05, .1, .2, .3, .5};
  /// Share of the total error that the least confident fraction of vertices
  /// holds, and that the fraction with the largest errors holds: the most that
  /// any ranking can reach.
  std::vector<double> held;
  std::vector<double> most;
  /// Mean error / diameter by tenths of the vertices, least confident first,
  /// and their mean confidence.
  std::vector<double> errors;
  std::vector<double> confidences;
};
ConfidenceCurve CurveOf(const std::vector<PairResult>& results);

/// Mean direct and best error after each stage, over the pairs that had it: of
/// a map that was turned around, the last one alone is kept.
std::vector<StageError> StageMeans(const std::vector<PairResult>& results);

}  // namespace isomatch::bench
