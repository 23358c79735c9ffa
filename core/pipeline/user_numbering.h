#pragma once

#include <stop_token>
#include <vector>

#include "absl/status/statusor.h"
#include "core/base/vertex_index.h"
#include "core/mesh/precise_point.h"
#include "core/mesh/surface_point.h"
#include "core/pipeline/prepared_mesh.h"

namespace isomatch {

/// A map between working vertices (X's, Y's) in the user's numbering.
VertexMap ToUserMap(const WorkingMesh& x, const WorkingMesh& y,
                    const VertexMap& y_from_x);

/// Points of Y's surface in the user's numbering; without any the vertices of
/// `user_map`. CANCELLED once `stop` is requested.
absl::StatusOr<std::vector<PrecisePoint>> ToUserPoints(
    const WorkingMesh& x, const WorkingMesh& y,
    const std::vector<SurfacePoint>& points, const VertexMap& user_map,
    const std::stop_token& stop);

}  // namespace isomatch
