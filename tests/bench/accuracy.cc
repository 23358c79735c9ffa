#include "tests/bench/accuracy.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <utility>

#include <nlohmann/json.hpp>

#include "absl/strings/str_format.h"
#include "client/files/text_file.h"
#include "core/base/status_macros.h"

namespace isomatch::bench {
namespace {

void PrintPair(const PairResult& result) {
  std::printf(
      "%-24s %-24s %7d %7d %8.4f %8.4f  %-8s %7.2f  %+.2f  %.5f  %.2f  "
      "%-8s  %s  %s %.2f\n",
      result.name_x.c_str(), result.name_y.c_str(), result.vertices_x,
      result.vertices_y, result.direct(), result.best(),
      result.failed()     ? (result.mirrored() ? "MIRRORED" : "FAILED")
      : result.mirrored() ? "mirrored"
                          : "ok",
      result.seconds, result.orientation_score, result.embedding_error,
      result.symmetry_confidence, VerdictName(result.verdict.level),
      result.iou ? absl::StrFormat("%.3f", *result.iou).c_str() : "-    ",
      RelationName(result.relation), result.relation_confidence);
  std::fflush(stdout);
}

void PrintSummary(const std::vector<PairResult>& results) {
  const Summary summary = Summarize(results);
  std::printf("\nmean error / diameter after each stage\n");
  for (const StageError& stage : StageMeans(results)) {
    std::printf("  %-18s direct %.4f  best %.4f\n", StageName(stage.stage),
                stage.direct, stage.best);
  }
  std::printf(
      "\n%zu pairs: direct mean %.4f median %.4f, best mean %.4f median %.4f, "
      "%d mirrored, %d failed (mean > %.1f), %.2f s a pair\n",
      results.size(), summary.direct_mean, summary.direct_median,
      summary.best_mean, summary.best_median, summary.mirrored, summary.failed,
      kFailed, summary.seconds_mean);
  if (!summary.iou_mean) return;
  std::printf("IoU of the overlap: mean %.4f median %.4f\n", *summary.iou_mean,
              summary.iou_median);
}

void PrintConfidence(const std::vector<PairResult>& results) {
  const ConfidenceCurve curve = CurveOf(results);
  std::printf(
      "\nshare of the total error held by the least confident "
      "vertices (by the worst ones: the most possible)\n");
  for (std::size_t i = 0; i < curve.held.size(); ++i) {
    std::printf("  %2.0f %%  %.3f (%.3f)\n", 100 * curve.kFractions[i],
                curve.held[i], curve.most[i]);
  }
  std::printf("mean error / diameter by tenth of confidence:");
  for (std::size_t i = 0; i < curve.errors.size(); ++i) {
    std::printf(" %.2f:%.4f", curve.confidences[i], curve.errors[i]);
  }
  std::printf("\n");
}

/// How often the verdict, which knows no truth, says what the truth says.
void PrintVerdicts(const std::vector<PairResult>& results) {
  constexpr double kRight = 0.03;
  std::printf("\nverdict                    good  doubtful  bad\n");
  const auto print = [&](const char* name, const auto& is_one) {
    std::array<int, 3> counts = {};
    for (const PairResult& result : results) {
      if (!is_one(result.direct())) continue;
      ++counts[static_cast<std::size_t>(result.verdict.level) - 1];
    }
    std::printf("  %-22s %6d %9d %4d\n", name, counts[0], counts[1], counts[2]);
  };
  print("error up to .03", [](double error) { return error <= kRight; });
  print("error .03 to .1",
        [](double error) { return error > kRight && error <= kFailed; });
  print("error above .1", [](double error) { return error > kFailed; });
}

/// What the shapes were taken for.
void PrintRelations(const std::vector<PairResult>& results) {
  std::printf("\ntaken for");
  for (const Relation relation : kRelations) {
    const auto count = std::count_if(
        results.begin(), results.end(),
        [&](const PairResult& result) { return result.relation == relation; });
    if (count == 0) continue;
    std::printf("  %s: %d", RelationName(relation), static_cast<int>(count));
  }
  std::printf("\n");
}

nlohmann::json ToJson(const PairResult& result) {
  nlohmann::json stages = nlohmann::json::array();
  for (const StageError& stage : result.stages) {
    stages.push_back({{"stage", StageName(stage.stage)},
                      {"direct", stage.direct},
                      {"best", stage.best}});
  }
  return {{"x", result.name_x},
          {"y", result.name_y},
          {"vertices_x", result.vertices_x},
          {"vertices_y", result.vertices_y},
          {"direct", result.direct()},
          {"best", result.best()},
          {"mirrored", result.mirrored()},
          {"failed", result.failed()},
          {"seconds", result.seconds},
          {"embedding_error", result.embedding_error},
          {"orientation_score", result.orientation_score},
          {"symmetry_confidence", result.symmetry_confidence},
          {"verdict", VerdictName(result.verdict.level)},
          {"relation", RelationName(result.relation)},
          {"relation_confidence", result.relation_confidence},
          {"mean_confidence", result.mean_confidence},
          {"rank_value", result.rank_value},
          {"scale", result.scale},
          {"iou", result.iou.value_or(1)},
          {"stages", std::move(stages)}};
}

nlohmann::json ToJson(const std::vector<PairResult>& results,
                      const MatchOptions& options) {
  const Summary summary = Summarize(results);
  nlohmann::json pairs = nlohmann::json::array();
  for (const PairResult& result : results) pairs.push_back(ToJson(result));
  const ConfidenceCurve curve = CurveOf(results);
  return {{"profile", ProfileName(options.profile)},
          {"random_seed", options.random_seed},
          {"unit", "mean geodesic error / diameter of Y"},
          {"direct_mean", summary.direct_mean},
          {"direct_median", summary.direct_median},
          {"best_mean", summary.best_mean},
          {"best_median", summary.best_median},
          {"mirrored", summary.mirrored},
          {"failed", summary.failed},
          {"seconds_mean", summary.seconds_mean},
          {"iou_mean", summary.iou_mean.value_or(1)},
          {"iou_median", summary.iou_median},
          {"confidence",
           {{"fractions", curve.kFractions},
            {"held", curve.held},
            {"most", curve.most},
            {"mean_error_by_tenth", curve.errors},
            {"mean_confidence_by_tenth", curve.confidences}}},
          {"pairs", std::move(pairs)}};
}

}  // namespace

absl::Status RunAccuracy(const PairSelection& pairs,
                         const MatchOptions& options,
                         const std::string& out_path) {
  std::printf(
      "profile %s, random seed %llu; errors are fractions of the "
      "diameter of Y\n",
      ProfileName(options.profile),
      static_cast<unsigned long long>(options.random_seed));
  std::printf(
      "%-24s %-24s %7s %7s %8s %8s  %-8s %7s  %s  %s  %s  %-8s  %s    %s\n",
      "X", "Y", "n_X", "n_Y", "direct", "best", "truth", "seconds", "orient",
      "Eq. 8", "symmetry", "verdict", "IoU", "relation");
  ISOMATCH_ASSIGN_OR_RETURN(const std::vector<PairResult> results,
                            RunPairs(pairs, options, PrintPair));
  PrintConfidence(results);
  PrintVerdicts(results);
  if (options.relation == Relation::kAuto) PrintRelations(results);
  PrintSummary(results);
  if (out_path.empty()) return absl::OkStatus();
  return WriteFileAtomically(out_path, ToJson(results, options).dump(2) + "\n");
}

}  // namespace isomatch::bench
