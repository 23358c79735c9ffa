#pragma once

#include "client/sample/animal_body.h"
#include "core/base/random_stream.h"
#include "core/mesh/triangle_mesh.h"

namespace isomatch {

/// Returns the surface of `body` as a closed manifold with outward faces, cut
/// out of a grid of tetrahedra of edge about `step`, which is turned and
/// shifted at random. Triangles may be slivers.
TriangleMesh MarchTetrahedra(const AnimalBody& body, double step,
                             RandomStream& random);

}  // namespace isomatch
