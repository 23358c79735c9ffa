#pragma once

#include <functional>
#include <stop_token>

#include <Eigen/Core>

#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "core/base/vertex_index.h"
#include "core/matching/closeness.h"
#include "core/mesh/vertex_stars.h"

namespace isomatch {

/// A surface whose geodesic distances are hashed.
struct DenseMapSurface {
  const Closeness& closeness;
  const VertexStars& stars;
  /// What each vertex stands for.
  const Eigen::VectorXd& areas;
};

/// Returns the map that sends each vertex of X to the vertex of Y whose
/// closeness to all matched vertices is most alike,
///   argmin_y sum_i (k_X(x, x_i) - k_Y(y, y_i))^2:
/// Eq. 8 over the sparse matches with squares for magnitudes, which makes it a
/// nearest neighbor search. Dense, not injective. Takes the place of the
/// paper's second stage in the default profile.
///
/// By NearestBySamples: a valley of the sum next to where a sample went, which
/// is the deepest one but for a few vertices.
///
/// REQUIRES: at least one match. Time O((n_X + n_Y) matches), memory 4 (n_X +
/// n_Y) matches bytes. CANCELLED after `stop`.
absl::StatusOr<VertexMap> DenseMapFromMatches(
    const DenseMapSurface& x, const DenseMapSurface& y,
    absl::Span<const VertexMatch> matches, const std::stop_token& stop);

}  // namespace isomatch
