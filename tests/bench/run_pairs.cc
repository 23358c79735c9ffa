#include "tests/bench/run_pairs.h"

#include <algorithm>
#include <chrono>
#include <optional>
#include <set>

#include "absl/strings/str_cat.h"
#include "absl/time/time.h"
#include "client/c/deadline_timer.h"
#include "core/base/status_macros.h"
#include "core/evaluation/geodesic_error.h"
#include "core/evaluation/overlap_iou.h"
#include "core/io/draco_mesh.h"
#include "core/pipeline/correspondence.h"
#include "core/pipeline/matcher.h"
#include "tests/bench/machine.h"

namespace isomatch::bench {
namespace {

/// As the meter's, but a map that matches no vertex with a truth is as wrong as
/// can be.
absl::StatusOr<GeodesicError> Measure(const GeodesicErrorMeter& meter,
                                      const VertexMap& found,
                                      const VertexMap& truth) {
  bool meets = false;
  for (std::size_t x = 0; x < truth.size() && x < found.size(); ++x) {
    meets = meets || (found[x] != kNoVertex && truth[x] != kNoVertex);
  }
  if (meets) return meter.Measure(found, truth);
  GeodesicError error;
  error.mean_over_diameter = error.max_over_diameter = 1;
  return error;
}

absl::StatusOr<StageError> ErrorOf(const GeodesicErrorMeter& meter,
                                   const GroundTruth& truth,
                                   const StageMap& map) {
  StageError result = {map.stage};
  ISOMATCH_ASSIGN_OR_RETURN(const GeodesicError direct,
                            Measure(meter, map.y_from_x, truth.direct));
  result.direct = result.best = direct.mean_over_diameter;
  if (truth.mirrored.empty()) return result;
  ISOMATCH_ASSIGN_OR_RETURN(const GeodesicError mirrored,
                            Measure(meter, map.y_from_x, truth.mirrored));
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

absl::StatusOr<PairResult> RunPair(const MeshPair& pair,
                                   const PairSelection& selection,
                                   const MatchOptions& options) {
  const std::vector<Landmark> landmarks =
      TrueLandmarks(pair.truth.direct, selection.true_landmarks);
  const auto begin = std::chrono::steady_clock::now();
  MatchControl control;
  std::optional<DeadlineTimer> timer;
  if (selection.deadline > 0) {
    timer.emplace(absl::ToChronoNanoseconds(absl::Seconds(selection.deadline)));
    control.hurry = timer->passed();
  }
  ISOMATCH_ASSIGN_OR_RETURN(
      const Correspondence found,
      Match(pair.mesh_x, pair.mesh_y, landmarks, options, control));
  const auto end = std::chrono::steady_clock::now();
  PairResult result = {pair.name_x,
                       pair.name_y,
                       pair.mesh_x.num_vertices(),
                       pair.mesh_y.num_vertices(),
                       {},
                       std::chrono::duration<double>(end - begin).count(),
                       found.scores.embedding_error,
                       found.scores.orientation_score,
                       found.symmetry_confidence,
                       found.verdict,
                       found.relation,
                       found.relation_confidence,
                       found.quality.mean_confidence,
                       found.scores.rank_value,
                       found.scale,
                       found.ended_early,
                       {}};
  const GeodesicErrorMeter meter(pair.mesh_y);
  for (const StageMap& map : found.stage_maps) {
    ISOMATCH_ASSIGN_OR_RETURN(const StageError error,
                              ErrorOf(meter, pair.truth, map));
    result.stages.push_back(error);
  }
  ISOMATCH_ASSIGN_OR_RETURN(const GeodesicError final_error,
                            Measure(meter, found.y_from_x, pair.truth.direct));
  for (std::size_t x = 0; x < final_error.of_vertex.size(); ++x) {
    if (final_error.of_vertex[x] < 0) continue;
    result.rated.push_back({found.confidence[x], final_error.of_vertex[x]});
  }
  result.iou = OverlapIou(found.y_from_x, pair.truth.direct, pair.truth.named,
                          VertexAreas(pair.mesh_x));
  return result;
}

absl::StatusOr<TriangleMesh> ThroughDraco(const TriangleMesh& mesh) {
  ISOMATCH_ASSIGN_OR_RETURN(const EncodedMesh encoded, EncodeDraco(mesh));
  return DecodeDraco(encoded.bytes, encoded.vertex_order, mesh.num_vertices());
}

double Mean(const std::vector<double>& values) {
  double sum = 0;
  for (const double value : values) sum += value;
  return sum / static_cast<double>(values.size());
}

}  // namespace

absl::StatusOr<std::vector<PairResult>> RunPairs(
    const PairSelection& pairs, const MatchOptions& options,
    const std::function<void(const PairResult&)>& done) {
  const std::string list =
      pairs.list.empty() ? pairs.dir + "/pairs.txt" : pairs.list;
  ISOMATCH_ASSIGN_OR_RETURN(const auto names, ReadPairNames(list));
  MatchOptions with_stages = options;
  with_stages.keep_stage_maps = true;
  std::vector<PairResult> results;
  for (const auto& [name_x, name_y] : names) {
    const std::string names_of_both = absl::StrCat(name_x, " ", name_y);
    if (names_of_both.find(pairs.filter) == std::string::npos) continue;
    ISOMATCH_ASSIGN_OR_RETURN(MeshPair pair,
                              ReadPair(pairs.dir, name_x, name_y));
    if (pairs.as_sent) {
      ISOMATCH_ASSIGN_OR_RETURN(pair.mesh_x, ThroughDraco(pair.mesh_x));
      ISOMATCH_ASSIGN_OR_RETURN(pair.mesh_y, ThroughDraco(pair.mesh_y));
    }
    ISOMATCH_ASSIGN_OR_RETURN(PairResult result,
                              RunPair(pair, pairs, with_stages));
    done(result);
    results.push_back(std::move(result));
  }
  if (results.empty()) {
    return absl::InvalidArgumentError("no pair in " + list +
                                      " matches the filter");
  }
  return results;
}

Summary Summarize(const std::vector<PairResult>& results) {
  std::vector<double> direct;
  std::vector<double> best;
  std::vector<double> seconds;
  std::vector<double> ious;
  bool is_partial = false;
  Summary summary;
  for (const PairResult& result : results) {
    direct.push_back(result.direct());
    best.push_back(result.best());
    seconds.push_back(result.seconds);
    ious.push_back(result.iou.value_or(1));
    is_partial = is_partial || result.iou.has_value();
    summary.mirrored += result.mirrored();
    summary.failed += result.failed();
  }
  summary.direct_mean = Mean(direct);
  summary.direct_median = MedianOf(direct);
  summary.best_mean = Mean(best);
  summary.best_median = MedianOf(best);
  summary.seconds_mean = Mean(seconds);
  if (is_partial) summary.iou_mean = Mean(ious);
  summary.iou_median = MedianOf(ious);
  return summary;
}

ConfidenceCurve CurveOf(const std::vector<PairResult>& results) {
  std::vector<RatedVertex> all;
  for (const PairResult& result : results) {
    all.insert(all.end(), result.rated.begin(), result.rated.end());
  }
  double total = 0;
  for (const RatedVertex& vertex : all) total += vertex.error;
  const auto held = [&](double fraction) {
    const auto count = static_cast<std::size_t>(fraction * double(all.size()));
    double sum = 0;
    for (std::size_t i = 0; i < count; ++i) sum += all[i].error;
    return sum / total;
  };
  ConfidenceCurve curve;
  std::stable_sort(all.begin(), all.end(), [](const auto& a, const auto& b) {
    return a.error > b.error;
  });
  for (const double f : curve.kFractions) curve.most.push_back(held(f));
  std::stable_sort(all.begin(), all.end(), [](const auto& a, const auto& b) {
    return a.confidence < b.confidence;
  });
  for (const double f : curve.kFractions) curve.held.push_back(held(f));
  constexpr std::size_t kTenths = 10;
  for (std::size_t tenth = 0; tenth < kTenths; ++tenth) {
    const std::size_t begin = tenth * all.size() / kTenths;
    const std::size_t end = (tenth + 1) * all.size() / kTenths;
    double error = 0;
    double confidence = 0;
    for (std::size_t i = begin; i < end; ++i) {
      error += all[i].error;
      confidence += all[i].confidence;
    }
    curve.errors.push_back(error / double(end - begin));
    curve.confidences.push_back(confidence / double(end - begin));
  }
  return curve;
}

std::vector<StageError> StageMeans(const std::vector<PairResult>& results) {
  std::vector<StageError> means;
  for (const Stage stage : kStages) {
    StageError mean = {stage};
    double count = 0;
    for (const PairResult& result : results) {
      for (const StageError& error : result.stages) {
        if (error.stage != stage) continue;
        mean.direct += error.direct;
        mean.best += error.best;
        ++count;
      }
    }
    if (count == 0) continue;
    means.push_back({stage, mean.direct / count, mean.best / count});
  }
  return means;
}

}  // namespace isomatch::bench
