#pragma once

#include <stop_token>

#include "absl/status/statusor.h"
#include "core/base/vertex_index.h"
#include "core/mesh/triangle_mesh.h"

namespace isomatch {

/// Returns for each of `queries` which of `points` (a position in that list) is
/// nearest to it in space, in single precision over the extent of all
/// positions. REQUIRES: at least one point. CANCELLED after `stop`. Time
/// O(queries points).
absl::StatusOr<VertexMap> NearestVertices(const Positions& positions,
                                          const VertexMap& queries,
                                          const VertexMap& points,
                                          const std::stop_token& stop);

}  // namespace isomatch
