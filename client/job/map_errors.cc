#include "client/job/map_errors.h"

#include <cstdint>
#include <vector>

#include "client/files/map_file.h"
#include "core/base/status_macros.h"
#include "core/evaluation/overlap_iou.h"

namespace isomatch {

absl::StatusOr<MapErrors> MeasureAgainstTruth(const FoundMap& found,
                                              const TriangleMesh& mesh_y,
                                              const std::string& truth,
                                              const std::stop_token& stop) {
  ISOMATCH_ASSIGN_OR_RETURN(
      const GroundTruth known,
      ReadGroundTruth(truth, static_cast<std::int64_t>(found.vertices.size()),
                      mesh_y.num_vertices()));
  const GeodesicErrorMeter meter(mesh_y);
  const auto measure = [&](const VertexMap& true_vertices) {
    return found.places.empty()
               ? meter.Measure(found.vertices, true_vertices, stop)
               : meter.Measure(*found.faces, found.places, true_vertices, stop);
  };
  MapErrors errors;
  ISOMATCH_ASSIGN_OR_RETURN(errors.direct, measure(known.direct));
  if (!known.mirrored.empty()) {
    ISOMATCH_ASSIGN_OR_RETURN(errors.mirrored, measure(known.mirrored));
  }
  const std::vector<double> weights =
      found.mesh_x == nullptr ? std::vector<double>(found.vertices.size(), 1)
                              : VertexAreas(*found.mesh_x);
  errors.iou = OverlapIou(found.vertices, known.direct, known.named, weights);
  return errors;
}

}  // namespace isomatch
