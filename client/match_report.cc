#include "client/match_report.h"

#include <nlohmann/json.hpp>

#include "client/progress_display.h"

namespace isomatch {
namespace {

using Json = nlohmann::ordered_json;

Json MeshJson(const TriangleMesh& mesh, const v1::MeshSummary& summary) {
  return {{"vertices", mesh.num_vertices()},
          {"faces", mesh.num_faces()},
          {"area", summary.area()}};
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

}  // namespace

std::string FormatReport(const MatchRequest& request, const MatchResult& result,
                         const std::vector<std::string>& warnings) {
  const v1::ResultInfo& info = result.info;
  const bool is_paper = info.profile() == v1::PROFILE_PAPER;
  const Json report = {{"mesh_x", MeshJson(request.mesh_x, info.mesh_x())},
                       {"mesh_y", MeshJson(request.mesh_y, info.mesh_y())},
                       {"landmarks", request.landmarks.size()},
                       {"profile", is_paper ? "paper" : "default"},
                       {"random_seed", info.random_seed()},
                       {"seconds", StageSeconds(info)},
                       {"total_seconds", info.run_seconds()},
                       {"peak_resident_bytes", info.peak_resident_bytes()},
                       {"memory_estimate_bytes", result.memory_estimate_bytes},
                       {"unmatched", info.unmatched()},
                       {"embedding_error", info.embedding_error()},
                       {"objective", info.objective()},
                       {"orientation_score", info.orientation_score()},
                       {"warnings", AllWarnings(info, warnings)}};
  constexpr int kIndent = 2;
  // File names in warnings need not be UTF-8.
  return report.dump(kIndent, ' ', /*ensure_ascii=*/false,
                     Json::error_handler_t::replace) +
         "\n";
}

}  // namespace isomatch
