#pragma once

#include "absl/status/statusor.h"
#include "core/base/control.h"
#include "core/base/vertex_index.h"
#include "core/mesh/vertex_stars.h"
#include "core/spectral/spectral_basis.h"

namespace isomatch {

/// Sizes of the spectral bases that ZoomOut goes through.
struct ZoomOutOptions {
  int start = 20;
  int end = 120;
  int step = 5;
};

/// A mesh's eigenfunctions, and its edges.
struct SpectralSurface {
  const SpectralBasis& basis;
  const VertexStars& stars;
};

/// Refines a map by alternating between functional map and vertex map while
/// the bases grow from `start` to `end` functions (Melzi et al., ZoomOut,
/// 2019). `y_from_x` may be partial; the result is dense. Sizes are cut to the
/// bases at hand. Reports fractions in (0, 1].
///
/// REQUIRES: at least one match; 1 <= start <= end, step >= 1.
/// Time O(iterations n_X n_Y k), beyond 10^8 pairs of vertices O(iterations
/// (n_X + n_Y) k), see NearestOnSurface. CANCELLED after
/// control.stop.
absl::StatusOr<VertexMap> ZoomOut(const SpectralSurface& x,
                                  const SpectralSurface& y, VertexMap y_from_x,
                                  const ZoomOutOptions& options,
                                  const Control& control);

}  // namespace isomatch
