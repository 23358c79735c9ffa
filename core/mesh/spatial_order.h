#pragma once

#include <vector>

#include "core/base/vertex_index.h"
#include "core/mesh/triangle_mesh.h"

namespace isomatch {

/// Returns all vertices ordered along a Morton curve through space, ties by
/// index: those that follow each other lie near each other, so that what works
/// its way over the surface finds its next vertex in the cache. Files have them
/// in any order.
std::vector<VertexIndex> SpatialOrder(const Positions& positions);

}  // namespace isomatch
