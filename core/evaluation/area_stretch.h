#pragma once

#include <vector>

#include "absl/types/span.h"
#include "core/base/vertex_index.h"
#include "core/mesh/surface_point.h"
#include "core/mesh/triangle_mesh.h"

namespace isomatch {

/// Returns for each vertex of X how much a map stretches the surface there: ln
/// of the ratio of two areas, of the image of its surroundings and of these
/// surroundings, each a fraction of its mesh's whole area. 0 for an isometry,
/// mirrored or not, above where Y's surface is stretched, below where it is
/// pressed together.
///
/// Images of faces are the triangles between their vertices' images. Rounding
/// to vertices folds many of them over and collapses others; so areas count
/// with their sign, by Y's normals, and are averaged over edges, as often as it
/// takes to reach further than an edge of Y, before the ratio of their sizes is
/// taken. It is clamped to 1000 and 1 / 1000. Faces with a vertex without a
/// match do not count; NaN where no face counts.
///
/// REQUIRES: ValidateMesh of both, entries of y_from_x are vertices of Y or
/// kNoVertex. Time O(n log n) at equal resolution.
std::vector<float> LogAreaStretch(const TriangleMesh& mesh_x,
                                  const TriangleMesh& mesh_y,
                                  absl::Span<const VertexIndex> y_from_x);

/// The same where images lie on the faces of Y.
std::vector<float> LogAreaStretch(const TriangleMesh& mesh_x,
                                  const TriangleMesh& mesh_y,
                                  absl::Span<const SurfacePoint> images);

}  // namespace isomatch
