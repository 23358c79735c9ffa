#pragma once

#include <Eigen/Core>

#include "absl/status/statusor.h"
#include "core/mesh/triangle_mesh.h"
#include "core/spectral/cotan_laplacian.h"

namespace isomatch {

/// Returns n: the mean curvature at each vertex, 1 / mesh units, positive where
/// the surface is convex: half of normal . M^-1 L positions, diffused for a
/// time of radius^2, (M + radius^2 L)^-1 M, so that it speaks of features of
/// about that radius and not of the triangulation. 1 on the unit sphere, 0 in
/// the plane.
///
/// INTERNAL when the factorization fails. Time as a sparse Cholesky.
absl::StatusOr<Eigen::VectorXd> SmoothedMeanCurvature(
    const CotanLaplacian& laplacian, const Positions& positions,
    const Positions& normals, double radius);

}  // namespace isomatch
