#pragma once

#include <string>
#include <vector>

#include "absl/types/span.h"
#include "client/files/vertex_colors.h"
#include "core/base/vertex_index.h"
#include "core/mesh/triangle_mesh.h"

namespace isomatch {

/// A map to be looked at.
struct MapPicture {
  const TriangleMesh& mesh_x;
  const TriangleMesh& mesh_y;
  const VertexMap& y_from_x;
  /// Color of each vertex of Y.
  const Colors& colors_y;
  /// Confidence of each vertex of X, 0 to 1; empty when it is not known.
  absl::Span<const float> confidence;
};

/// Returns the bytes of a binary PLY file of X whose vertices have, beside x, y
/// and z, `y_index` (the vertex of Y, -1 for none), its place `y_x y_y y_z`
/// (NaN for none), its color `red green blue` (gray for none) and, if known,
/// `confidence`.
std::string FormatMapPly(const MapPicture& picture);

}  // namespace isomatch
