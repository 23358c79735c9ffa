#include "core/pipeline/quality_report.h"

#include "core/base/status_macros.h"
#include "core/evaluation/map_quality.h"
#include "core/mesh/vertex_stars.h"
#include "core/pipeline/confidence.h"

namespace isomatch {
namespace {

/// Values of solved vertices at one of all vertices.
float ValueAt(const PreparedMesh& x, const Eigen::VectorXd& values,
              VertexIndex v) {
  if (!x.coarse) return static_cast<float>(values[v]);
  return static_cast<float>(Interpolated(values, x.coarse->working.mesh.faces,
                                         x.coarse->embedding[v])[0]);
}

}  // namespace

absl::StatusOr<std::vector<float>> ReportQuality(const PreparedMesh& x,
                                                 const PreparedMesh& y,
                                                 const SolvedMap& map,
                                                 const std::stop_token& stop,
                                                 MapQuality* quality) {
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
      MeasureMap(mesh_x, x.hash.basis, mesh_y,
                 {map.y_from_x, images, map.matched}, stop));
  quality->geodesic_distortion = measures.geodesic_distortion;
  quality->coverage = measures.coverage;
  quality->area_distortion = measures.area_distortion;
  std::vector<float> offsets = map.offsets;
  // What is not matched says nothing of its neighbors.
  for (std::size_t v = 0; v < map.matched.size(); ++v) {
    if (map.matched[v]) continue;
    for (std::vector<float>* sign : {&moved, &residuals, &offsets}) {
      if (!sign->empty()) (*sign)[v] = -1;
    }
  }
  return ConfidenceOf({measures.distortions, moved, residuals, offsets},
                      x.solved().stars);
}

std::vector<float> UserConfidence(const PreparedMesh& x,
                                  const std::vector<float>& confidence) {
  const Eigen::VectorXd values =
      Eigen::Map<const Eigen::VectorXf>(
          confidence.data(), static_cast<Eigen::Index>(confidence.size()))
          .cast<double>();
  std::vector<float> of_user;
  for (const VertexIndex v : x.full.working_from_user) {
    of_user.push_back(v == kNoVertex ? 0 : ValueAt(x, values, v));
  }
  return of_user;
}

}  // namespace isomatch
