#include "core/pipeline/quality_report.h"

#include <algorithm>

#include "core/base/status_macros.h"
#include "core/evaluation/map_quality.h"
#include "core/mesh/vertex_stars.h"
#include "core/pipeline/confidence.h"
#include "core/pipeline/user_numbering.h"

namespace isomatch {
namespace {

/// Values of solved vertices at one of all vertices.
float ValueAt(const PreparedMesh& x, const Eigen::VectorXd& values,
              VertexIndex v) {
  if (!x.coarse) return static_cast<float>(values[v]);
  return static_cast<float>(Interpolated(values, x.coarse->working.mesh.faces,
                                         x.coarse->embedding.points[v])[0]);
}

}  // namespace

absl::Status ReportQuality(const PreparedMesh& x, const PreparedMesh& y,
                           const SolvedMap& map, const std::stop_token& stop,
                           Correspondence* result) {
  const TriangleMesh& mesh_x = x.solved().mesh;
  const TriangleMesh& mesh_y = y.solved().mesh;
  Positions images = mesh_y.positions(map.y_from_x, Eigen::all);
  std::vector<float> moved;
  std::vector<float> residuals;
  if (map.alignment != nullptr) {
    for (VertexIndex v = 0; v < mesh_x.num_vertices(); ++v) {
      moved.push_back(static_cast<float>(
          (images.row(v) - mesh_y.positions.row(map.filtered[v])).norm()));
      residuals.push_back(static_cast<float>(map.alignment->Residual(v)));
      images.row(v) = PositionOf(mesh_y, map.points[v]);
    }
  }
  ISOMATCH_ASSIGN_OR_RETURN(
      const MapMeasures measures,
      MeasureMap(mesh_x, x.hash.basis, mesh_y, {map.y_from_x, images}, stop));
  const std::vector<float> of_solved = ConfidenceOf(
      {measures.distortions, moved, residuals, map.offsets}, x.solved().stars);
  const Eigen::VectorXd confidence =
      Eigen::Map<const Eigen::VectorXf>(
          of_solved.data(), static_cast<Eigen::Index>(of_solved.size()))
          .cast<double>();
  result->matched_y = MatchedY(y.full);
  for (const VertexIndex v : x.full.working_from_user) {
    result->confidence.push_back(v == kNoVertex ? 0
                                                : ValueAt(x, confidence, v));
  }
  result->quality = {
      measures.geodesic_distortion, measures.coverage, measures.area_distortion,
      static_cast<int>(std::count(result->y_from_x.begin(),
                                  result->y_from_x.end(), kNoVertex))};
  return absl::OkStatus();
}

}  // namespace isomatch
