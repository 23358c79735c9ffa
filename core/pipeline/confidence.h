#pragma once

#include <vector>

#include "absl/types/span.h"
#include "core/base/vertex_index.h"
#include "core/mesh/vertex_stars.h"

namespace isomatch {

/// Signs of error at the vertices of X, in sqrt(area).
struct ErrorSigns {
  /// Median geodesic distortion (core/evaluation/map_quality.h).
  absl::Span<const float> distortions;
  /// How far the elastic alignment moved the image since the wavelet filter,
  /// how far the laid-on surface stays away from it, and how far from it the
  /// vertex with the most alike descriptor lies. A negative entry is not known.
  /// Each may be empty.
  absl::Span<const float> moved;
  absl::Span<const float> residuals;
  absl::Span<const float> offsets;
};

/// Averages over one-rings, over and over: signs are noisy, errors are not.
/// Negative values are not known, and become what is known around them.
std::vector<double> Smoothed(absl::Span<const float> values,
                             const VertexStars& stars, int rounds);

/// Returns the confidence of each vertex, exp(-e / 0.05) for an expected error
/// e, in sqrt(area), that is linear in the signs averaged over neighborhoods.
/// The coefficients were fitted to the true errors of 23 FAUST and TOSCA pairs;
/// see core/EXPERIMENTS.md for how well it ranks.
std::vector<float> ConfidenceOf(const ErrorSigns& signs,
                                const VertexStars& stars_x);

/// Mean over the vertices that have an image in `y_from_x`; 0 where none has.
double MeanConfidence(absl::Span<const float> confidence,
                      const VertexMap& y_from_x);

}  // namespace isomatch
