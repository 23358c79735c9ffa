#pragma once

#include <string>

#include "absl/status/status.h"
#include "client/picture/image.h"
#include "client/viewer/pair_view.h"
#include "client/viewer/rasterizer.h"

namespace isomatch {

struct PictureOptions {
  static constexpr int kMinSide = 64;
  static constexpr int kMaxSide = 8192;

  /// Pixels, kMinSide to kMaxSide each.
  int width = 1600;
  int height = 800;
  /// "colors", or the id of a layer of the view.
  std::string layer = "colors";
  Pattern pattern = Pattern::kPlain;
};

/// Draws X on the left half and Y on the right one, on white, at one scale
/// where their areas are equal, each in the middle of its half. A scalar layer
/// has its scale below, low end left.
///
/// REQUIRES: options in range, the layer is there. Memory 7 bytes for each
/// sample of one half, of which a pixel has four. Deterministic.
Image DrawPair(const PairView& view, const PictureOptions& options);

/// Returns n x 3: where the pattern puts each vertex, in stripes; the longest
/// side of the box, axis 0, has kStripes of them.
Positions PatternPlaces(const TriangleMesh& mesh);

}  // namespace isomatch
