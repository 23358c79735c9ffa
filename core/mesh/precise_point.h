#pragma once

#include <array>

#include "core/base/vertex_index.h"

namespace isomatch {

/// A place on Y between the vertices of one of its faces, as users get it.
/// Named by vertices, not by face as SurfacePoint is, since a face's number
/// need not survive compression.
struct PrecisePoint {
  /// Vertices of a face of Y, counter-clockwise; kNoVertex for no place.
  std::array<VertexIndex, 3> vertices = {kNoVertex, kNoVertex, kNoVertex};
  /// Barycentric coordinates, each in [0, 1], sum 1.
  std::array<double, 3> weights = {0, 0, 0};
};

}  // namespace isomatch
