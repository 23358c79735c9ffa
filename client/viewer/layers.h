#pragma once

#include <cstdint>
#include <vector>

#include "absl/types/span.h"
#include "client/viewer/pair_view.h"
#include "core/base/vertex_index.h"
#include "core/evaluation/geodesic_error.h"
#include "core/mesh/surface_point.h"
#include "core/mesh/triangle_mesh.h"

namespace isomatch {

/// Two shapes and the map between them, as references.
struct MappedPair {
  const TriangleMesh& mesh_x;
  const TriangleMesh& mesh_y;
  absl::Span<const VertexIndex> y_from_x;
  /// PairView::precise.
  absl::Span<const SurfacePoint> precise = {};
  /// PairView::matched_y.
  absl::Span<const std::uint8_t> matched_y = {};
};

// Vertices without a counterpart have no number in any layer.

/// `confidence` of each vertex of X, 0 to 1.
ScalarLayer ConfidenceLayer(const MappedPair& pair,
                            std::vector<float> confidence);

/// GeodesicError::of_vertex, as a fraction of Y's diameter. The scale ends at
/// 1, 2 or 5 times a power of ten that 98 % stay below, not under 0.01.
ScalarLayer ErrorLayer(const MappedPair& pair, const GeodesicError& error);

/// LogAreaStretch (core/evaluation/area_stretch.h), scale -1 to 1.
ScalarLayer DistortionLayer(const MappedPair& pair);

}  // namespace isomatch
