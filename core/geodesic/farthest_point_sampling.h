#pragma once

#include <stop_token>
#include <vector>

#include "absl/status/statusor.h"
#include "core/base/vertex_index.h"
#include "core/geodesic/distance_field_solver.h"

namespace isomatch {

/// Returns `count` vertices (all of them when there are fewer), each farthest
/// from those before it; ties go to the smallest index. The first is an
/// extremity: farthest from the vertex farthest from vertex 0, so that two
/// poses of a shape start alike. Unreached components come before farther
/// points of reached ones. A prefix of the result is the result of a smaller
/// count.
///
/// Time O(n log count) on evenly sampled meshes, as each new point corrects
/// only its own surroundings; memory 4 bytes a vertex.
absl::StatusOr<std::vector<VertexIndex>> FarthestPoints(
    const DistanceFieldSolver& solver, int count, const std::stop_token& stop);

}  // namespace isomatch
