#pragma once

#include <vector>

#include "absl/types/span.h"
#include "client/picture/colors.h"
#include "client/picture/image.h"
#include "core/mesh/triangle_mesh.h"

namespace isomatch {

/// What is drawn over the colors.
enum class Pattern { kPlain, kStripes, kChecker };

/// A surface as the viewer sees it.
struct DrawnSurface {
  /// n x 3: pixels from the left, pixels from the top, nearness.
  Positions points;
  const Faces& faces;
  /// n x 3 unit vectors: right, up, to the viewer.
  Positions normals;
  absl::Span<const Rgb> colors;
  /// n x 3: where the pattern puts each vertex, in stripes.
  const Positions& places;
};

/// Draws a surface on `image` with smooth shading and a depth buffer of its
/// own; both sides of faces are seen. What lies outside is left out. Light
/// comes from above the viewer's left shoulder, as in src/surface.js.
///
/// Time O(m + pixels covered), memory 4 bytes a pixel. Deterministic.
void DrawSurface(const DrawnSurface& surface, Pattern pattern, Image& image);

/// Returns `image` at half its size, each pixel the mean of four.
/// REQUIRES: even sides.
Image HalfSize(const Image& image);

}  // namespace isomatch
