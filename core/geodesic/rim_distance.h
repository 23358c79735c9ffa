#pragma once

#include <vector>

#include "core/geodesic/distance_field_solver.h"
#include "core/mesh/triangle_mesh.h"

namespace isomatch {

/// Returns the distance of every vertex from the rim, the vertices of edges
/// with one face alone, in mesh units; kUnreachable where a component has
/// none. Time O(n log n) and more where the rim is long.
std::vector<float> RimDistances(const TriangleMesh& mesh,
                                const DistanceFieldSolver& solver);

}  // namespace isomatch
