#include "client/c/report.h"

#include <cstddef>

#include <nlohmann/json.hpp>

namespace isomatch {
namespace {

using Json = nlohmann::ordered_json;

Json MeshJson(MeshSize size, double area) {
  return {{"vertices", size.vertices}, {"faces", size.faces}, {"area", area}};
}

Json ScoresJson(const MapScores& scores) {
  return {{"embedding_error", scores.embedding_error},
          {"orientation_score", scores.orientation_score},
          {"curvature_mismatch", scores.curvature_mismatch},
          {"normal_mismatch", scores.normal_mismatch},
          {"descriptor_mismatch", scores.descriptor_mismatch},
          {"stretch", scores.stretch},
          {"landmark_contradiction", scores.landmark_contradiction},
          {"rank_value", scores.rank_value}};
}

Json QualityJson(const MapQuality& quality) {
  return {{"geodesic_distortion", quality.geodesic_distortion},
          {"coverage", quality.coverage},
          {"area_distortion", quality.area_distortion},
          {"mean_confidence", quality.mean_confidence}};
}

Json LandmarksJson(const std::vector<Landmark>& landmarks,
                   const std::vector<LandmarkOutcome>& outcomes) {
  Json all = Json::array();
  for (std::size_t i = 0; i < outcomes.size(); ++i) {
    all.push_back({{"x", landmarks[i].x},
                   {"y", landmarks[i].y},
                   {"kept", outcomes[i].kept},
                   {"y_found", outcomes[i].y_found},
                   {"distance", outcomes[i].distance}});
  }
  return all;
}

Json AlternativesJson(const std::vector<Alternative>& alternatives) {
  Json all = Json::array();
  for (const Alternative& alternative : alternatives) {
    all.push_back({{"scores", ScoresJson(alternative.scores)}});
  }
  return all;
}

Json WarningsJson(const Correspondence& found) {
  Json all = Json::array();
  for (const std::string& text : found.warnings_x) all.push_back("X: " + text);
  for (const std::string& text : found.warnings_y) all.push_back("Y: " + text);
  for (const std::string& text : found.warnings) all.push_back(text);
  return all;
}

}  // namespace

std::string FormatReport(const Correspondence& found, const Matched& matched,
                         const MatchOptions& options) {
  const bool is_paper = options.profile == Profile::kPaper;
  const Json report = {
      {"mesh_x", MeshJson(matched.x, found.area_x)},
      {"mesh_y", MeshJson(matched.y, found.area_y)},
      {"verdict",
       {{"level", VerdictName(found.verdict.level)},
        {"reason", found.verdict.reason},
        {"advice", found.verdict.advice}}},
      {"landmarks", LandmarksJson(matched.landmarks, found.landmarks)},
      {"profile", is_paper ? "paper" : "default"},
      {"relation", RelationName(found.relation)},
      {"relation_confidence", found.relation_confidence},
      {"scale", found.scale},
      {"random_seed", options.random_seed},
      {"ended_early", found.ended_early},
      {"unmatched", found.quality.unmatched},
      {"embedding_error", found.scores.embedding_error},
      {"objective", found.objective},
      {"orientation_score", found.scores.orientation_score},
      {"scores", ScoresJson(found.scores)},
      {"quality", QualityJson(found.quality)},
      {"symmetry_confidence", found.symmetry_confidence},
      {"alternatives", AlternativesJson(found.alternatives)},
      {"warnings", WarningsJson(found)}};
  return report.dump(/*indent=*/2);
}

}  // namespace isomatch
