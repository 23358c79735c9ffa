#include "tests/bench/run_pairs.h"

#include <algorithm>
#include <chrono>
#include <set>

#include "core/base/status_macros.h"
#include "core/evaluation/geodesic_error.h"

namespace isomatch::bench {
namespace {

absl::StatusOr<StageError> ErrorOf(const GeodesicErrorMeter& meter,
                                   const GroundTruth& truth,
                                   const StageMap& map) {
  StageError result = {map.stage};
  ISOMATCH_ASSIGN_OR_RETURN(const GeodesicError direct,
                            meter.Measure(map.y_from_x, truth.direct));
  result.direct = result.best = direct.mean_over_diameter;
  if (truth.mirrored.empty()) return result;
  ISOMATCH_ASSIGN_OR_RETURN(const GeodesicError mirrored,
                            meter.Measure(map.y_from_x, truth.mirrored));
  result.best = std::min(result.best, mirrored.mean_over_diameter);
  return result;
}

/// Up to `count` matches of the truth, evenly from its list, each vertex once.
std::vector<Landmark> TrueLandmarks(const VertexMap& truth, int count) {
  std::vector<Landmark> landmarks;
  std::set<VertexIndex> taken;
  for (int i = 0; i < count; ++i) {
    const std::size_t x = i * truth.size() / count;
    if (truth[x] == kNoVertex || !taken.insert(truth[x]).second) continue;
    landmarks.push_back({static_cast<VertexIndex>(x), truth[x]});
  }
  return landmarks;
}

absl::StatusOr<PairResult> RunPair(const MeshPair& pair, int true_landmarks,
                                   const MatchOptions& options) {
  const std::vector<Landmark> landmarks =
      TrueLandmarks(pair.truth.direct, true_landmarks);
  const auto begin = std::chrono::steady_clock::now();
  ISOMATCH_ASSIGN_OR_RETURN(
      const Correspondence found,
      Match(pair.mesh_x, pair.mesh_y, landmarks, options));
  const auto end = std::chrono::steady_clock::now();
  PairResult result = {pair.name_x,
                       pair.name_y,
                       pair.mesh_x.num_vertices(),
                       pair.mesh_y.num_vertices(),
                       {},
                       std::chrono::duration<double>(end - begin).count(),
                       found.embedding_error,
                       found.orientation_score};
  const GeodesicErrorMeter meter(pair.mesh_y);
  for (const StageMap& map : found.stage_maps) {
    ISOMATCH_ASSIGN_OR_RETURN(const StageError error,
                              ErrorOf(meter, pair.truth, map));
    result.stages.push_back(error);
  }
  return result;
}

double Median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const std::size_t n = values.size();
  return n % 2 == 1 ? values[n / 2] : 0.5 * (values[n / 2 - 1] + values[n / 2]);
}

double Mean(const std::vector<double>& values) {
  double sum = 0;
  for (const double value : values) sum += value;
  return sum / static_cast<double>(values.size());
}

}  // namespace

absl::StatusOr<std::vector<PairResult>> RunPairs(
    const std::string& dir, const std::string& filter, int true_landmarks,
    const MatchOptions& options,
    const std::function<void(const PairResult&)>& done) {
  ISOMATCH_ASSIGN_OR_RETURN(const auto names, ReadPairNames(dir));
  MatchOptions with_stages = options;
  with_stages.keep_stage_maps = true;
  std::vector<PairResult> results;
  for (const auto& [name_x, name_y] : names) {
    if ((name_x + " " + name_y).find(filter) == std::string::npos) continue;
    ISOMATCH_ASSIGN_OR_RETURN(const MeshPair pair,
                              ReadPair(dir, name_x, name_y));
    ISOMATCH_ASSIGN_OR_RETURN(PairResult result,
                              RunPair(pair, true_landmarks, with_stages));
    done(result);
    results.push_back(std::move(result));
  }
  if (results.empty()) {
    return absl::InvalidArgumentError("no pair in " + dir +
                                      "/pairs.txt matches the filter");
  }
  return results;
}

Summary Summarise(const std::vector<PairResult>& results) {
  std::vector<double> direct;
  std::vector<double> best;
  std::vector<double> seconds;
  Summary summary;
  for (const PairResult& result : results) {
    direct.push_back(result.direct());
    best.push_back(result.best());
    seconds.push_back(result.seconds);
    summary.mirrored += result.mirrored();
    summary.failed += result.failed();
  }
  summary.direct_mean = Mean(direct);
  summary.direct_median = Median(direct);
  summary.best_mean = Mean(best);
  summary.best_median = Median(best);
  summary.seconds_mean = Mean(seconds);
  return summary;
}

std::vector<StageError> StageMeans(const std::vector<PairResult>& results) {
  std::vector<StageError> means;
  for (std::size_t s = 0; s < results.front().stages.size(); ++s) {
    means.push_back({results.front().stages[s].stage});
    for (const PairResult& result : results) {
      means[s].direct += result.stages[s].direct / double(results.size());
      means[s].best += result.stages[s].best / double(results.size());
    }
  }
  return means;
}

}  // namespace isomatch::bench
