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
///   argmin_y sum_i (k_X(x, x_i) - k_Y(y, y_i))^2,
/// ties by smallest index: Eq. 8 over the sparse matches with squares for
/// magnitudes, which makes it a nearest neighbor search. Dense, not injective.
/// Takes the place of the paper's second stage in the default profile.
///
/// REQUIRES: at least one match. Large surfaces are searched as
/// NearestOnSurface does: exact up to 10^8
/// pairs of vertices, in time O(n_X n_Y matches), beyond in O((n_X + n_Y)
/// matches). Memory 4 (n_X + n_Y) matches bytes. CANCELLED after
/// `stop`.
absl::StatusOr<VertexMap> DenseMapFromMatches(
    const DenseMapSurface& x, const DenseMapSurface& y,
    absl::Span<const VertexMatch> matches, const std::stop_token& stop);

}  // namespace isomatch
