#include "core/pipeline/conclusion.h"

#include <algorithm>

#include "core/base/status_macros.h"
#include "core/evaluation/map_quality.h"
#include "core/matching/matching.h"
#include "core/mesh/vertex_stars.h"
#include "core/pipeline/confidence.h"

namespace isomatch {

VertexMap ToUserMap(const std::array<WorkingMesh, 2>& working,
                    const VertexMap& y_from_x) {
  VertexMap user_map;
  for (const VertexIndex x : working[kX].working_from_user) {
    const VertexIndex y = x == kNoVertex ? kNoVertex : y_from_x[x];
    user_map.push_back(y == kNoVertex ? kNoVertex
                                      : working[kY].user_from_working[y]);
  }
  return user_map;
}

std::vector<PrecisePoint> PrecisePoints(
    const std::array<WorkingMesh, 2>& working,
    const ElasticAlignment* alignment, const VertexMap& user_map) {
  std::vector<PrecisePoint> points(user_map.size());
  for (std::size_t u = 0; u < user_map.size(); ++u) {
    const VertexIndex x = working[kX].working_from_user[u];
    const VertexIndex y = user_map[u];
    if (x == kNoVertex || y == kNoVertex) continue;
    if (alignment == nullptr) {
      points[u] = {{y, y, y}, {1, 0, 0}};
      continue;
    }
    const SurfacePoint& found = alignment->points()[x];
    for (int corner = 0; corner < 3; ++corner) {
      points[u].vertices[corner] =
          working[kY]
              .user_from_working[working[kY].mesh.faces(found.face, corner)];
      points[u].weights[corner] = found.weights[corner];
    }
  }
  return points;
}

absl::Status ReportQuality(const std::array<WorkingMesh, 2>& working,
                           const VertexMap& y_from_x, const VertexMap& filtered,
                           const std::vector<float>& offsets,
                           const ElasticAlignment* alignment,
                           const std::stop_token& stop,
                           Correspondence* result) {
  const TriangleMesh& mesh_x = working[kX].mesh;
  const TriangleMesh& mesh_y = working[kY].mesh;
  Positions images = mesh_y.positions(y_from_x, Eigen::all);
  std::vector<float> moved;
  std::vector<float> residuals;
  if (alignment != nullptr) {
    for (VertexIndex x = 0; x < mesh_x.num_vertices(); ++x) {
      moved.push_back(static_cast<float>(
          (images.row(x) - mesh_y.positions.row(filtered[x])).norm()));
      residuals.push_back(static_cast<float>(alignment->Residual(x)));
      images.row(x) = PositionOf(mesh_y, alignment->points()[x]);
    }
  }
  ISOMATCH_ASSIGN_OR_RETURN(const MapMeasures measures,
                            MeasureMap(mesh_x, mesh_y, y_from_x, images, stop));
  const std::vector<float> confidence = ConfidenceOf(
      {measures.distortions, moved, residuals, offsets}, working[kX].stars);
  for (const VertexIndex x : working[kX].working_from_user) {
    result->confidence.push_back(x == kNoVertex ? 0 : confidence[x]);
  }
  result->quality = {
      measures.geodesic_distortion, measures.coverage, measures.area_distortion,
      static_cast<int>(std::count(result->y_from_x.begin(),
                                  result->y_from_x.end(), kNoVertex))};
  return absl::OkStatus();
}

}  // namespace isomatch
