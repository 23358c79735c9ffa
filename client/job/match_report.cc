#include "client/job/match_report.h"

#include <nlohmann/json.hpp>

#include "client/job/job_labels.h"
#include "core/pipeline/match_options.h"

namespace isomatch {
namespace {

using Json = nlohmann::ordered_json;

Json MeshJson(const v1::MeshSummary& mesh) {
  return {{"vertices", mesh.vertices()},
          {"faces", mesh.faces()},
          {"area", mesh.area()}};
}

Json StageSeconds(const v1::ResultInfo& info) {
  Json seconds = Json::object();
  for (const v1::StageTime& time : info.stage_times()) {
    seconds[StageLabel(time.stage())] = time.seconds();
  }
  return seconds;
}

Json AllWarnings(const v1::ResultInfo& info,
                 const std::vector<std::string>& warnings) {
  Json all = warnings;
  for (const auto& warning : info.mesh_x().warnings()) {
    all.push_back("X: " + warning);
  }
  for (const auto& warning : info.mesh_y().warnings()) {
    all.push_back("Y: " + warning);
  }
  for (const auto& warning : info.warnings()) all.push_back(warning);
  return all;
}

Json ScoresJson(const v1::MapScores& scores) {
  return {{"embedding_error", scores.embedding_error()},
          {"orientation_score", scores.orientation_score()},
          {"curvature_mismatch", scores.curvature_mismatch()},
          {"normal_mismatch", scores.normal_mismatch()},
          {"descriptor_mismatch", scores.descriptor_mismatch()},
          {"stretch", scores.stretch()},
          {"landmark_contradiction", scores.landmark_contradiction()},
          {"rank_value", scores.rank_value()}};
}

Json QualityJson(const v1::MapQuality& quality) {
  return {{"geodesic_distortion", quality.geodesic_distortion()},
          {"coverage", quality.coverage()},
          {"area_distortion", quality.area_distortion()},
          {"mean_confidence", quality.mean_confidence()}};
}

Json VerdictJson(const v1::Verdict& verdict) {
  return {{"level", VerdictLabel(verdict)},
          {"reason", verdict.reason()},
          {"advice", verdict.advice()}};
}

Json AlternativesJson(const v1::ResultInfo& info) {
  Json alternatives = Json::array();
  for (const v1::Alternative& alternative : info.alternatives()) {
    alternatives.push_back({{"scores", ScoresJson(alternative.scores())}});
  }
  return alternatives;
}

Json LandmarksJson(const v1::ResultInfo& info) {
  Json landmarks = Json::array();
  for (const v1::LandmarkOutcome& outcome : info.landmarks()) {
    landmarks.push_back(
        {{"x", outcome.landmark().x()},
         {"y", outcome.landmark().y()},
         {"kept", outcome.kept()},
         // 0xFFFFFFFF is kNoVertex.
         {"y_found", static_cast<VertexIndex>(outcome.y_found())},
         {"distance", outcome.distance()}});
  }
  return landmarks;
}

}  // namespace

std::string FormatReport(const MatchResult& result,
                         const std::vector<std::string>& warnings) {
  const v1::ResultInfo& info = result.info;
  const bool is_paper = info.profile() == v1::PROFILE_PAPER;
  const auto relation = static_cast<Relation>(info.relation());
  const Json report = {{"mesh_x", MeshJson(info.mesh_x())},
                       {"mesh_y", MeshJson(info.mesh_y())},
                       {"verdict", VerdictJson(info.verdict())},
                       {"landmarks", LandmarksJson(info)},
                       {"profile", is_paper ? "paper" : "default"},
                       {"relation", RelationName(relation)},
                       {"relation_confidence", info.relation_confidence()},
                       {"scale", info.scale()},
                       {"random_seed", info.random_seed()},
                       {"ended_early", info.ended_early()},
                       {"seconds", StageSeconds(info)},
                       {"total_seconds", info.run_seconds()},
                       {"peak_resident_bytes", info.peak_resident_bytes()},
                       {"memory_estimate_bytes", result.memory_estimate_bytes},
                       {"unmatched", info.unmatched()},
                       {"embedding_error", info.embedding_error()},
                       {"objective", info.objective()},
                       {"orientation_score", info.orientation_score()},
                       {"scores", ScoresJson(info.scores())},
                       {"quality", QualityJson(info.quality())},
                       {"symmetry_confidence", info.symmetry_confidence()},
                       {"alternatives", AlternativesJson(info)},
                       {"warnings", AllWarnings(info, warnings)}};
  constexpr int kIndent = 2;
  // File names in warnings need not be UTF-8.
  return report.dump(kIndent, ' ', /*ensure_ascii=*/false,
                     Json::error_handler_t::replace) +
         "\n";
}

}  // namespace isomatch
