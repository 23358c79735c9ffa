#pragma once

#include <stop_token>
#include <vector>

#include "absl/status/status.h"
#include "core/alignment/elastic_alignment.h"
#include "core/base/vertex_index.h"
#include "core/mesh/surface_point.h"
#include "core/pipeline/correspondence.h"
#include "core/pipeline/prepared_mesh.h"

namespace isomatch {

/// A map between solved vertices and what is known of where it is wrong.
struct SolvedMap {
  const VertexMap& y_from_x;
  const std::vector<SurfacePoint>& points;
  /// What y_from_x was before the alignment; with `offsets`, how far from the
  /// images the most alike vertices lie (ErrorSigns), unused without one.
  const VertexMap& filtered;
  const std::vector<float>& offsets;
  const ElasticAlignment* alignment;
};

/// Fills result->quality, result->confidence and result->matched_y: measured on
/// solved vertices, interpolated in between. REQUIRES: result->y_from_x.
absl::Status ReportQuality(const PreparedMesh& x, const PreparedMesh& y,
                           const SolvedMap& map, const std::stop_token& stop,
                           Correspondence* result);

}  // namespace isomatch
