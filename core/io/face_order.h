#pragma once

#include "core/mesh/triangle_mesh.h"

namespace isomatch {

/// Turns each face so that its smallest vertex is first, and puts them in
/// lexicographic order, as DecodeDraco does: encoders may change both, and the
/// method sums over faces in their order. REQUIRES: entries in [0, end). Time
/// O(m + end) where vertices have few faces.
void SortFaces(VertexIndex end, Faces& faces);

}  // namespace isomatch
