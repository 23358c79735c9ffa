#pragma once

#include <stop_token>
#include <vector>

#include "absl/status/statusor.h"
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
  /// Not 0 for the vertices that count; empty: all.
  const std::vector<char>& matched;
};

/// Fills what is measured of `quality` and returns the confidence of the solved
/// vertices of X. Errors as MeasureMap.
absl::StatusOr<std::vector<float>> ReportQuality(const PreparedMesh& x,
                                                 const PreparedMesh& y,
                                                 const SolvedMap& map,
                                                 const std::stop_token& stop,
                                                 MapQuality* quality);

/// Values of solved vertices for the user's: interpolated, 0 on no face.
std::vector<float> UserConfidence(const PreparedMesh& x,
                                  const std::vector<float>& confidence);

}  // namespace isomatch
