#pragma once

#include <stop_token>
#include <vector>

#include <Eigen/Core>

#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "core/base/nearest_columns.h"
#include "core/base/vertex_index.h"
#include "core/mesh/triangle_mesh.h"
#include "core/mesh/vertex_stars.h"

namespace isomatch {

/// An oriented surface. References must outlive what is made of it.
struct DescribedSurface {
  const TriangleMesh& mesh;
  /// n x 3, unit length.
  const Positions& normals;
  /// n, the area that each vertex stands for, squared mesh units.
  const Eigen::VectorXd& areas;
  const VertexStars& stars;
};

/// Entries of a descriptor.
inline constexpr int kShotSize = 352;
/// Entries of each histogram of a descriptor.
inline constexpr int kShotCosines = 11;

/// ShotBall::least_cosine that leaves out a limb's other side.
inline constexpr double kFacing = 0.2;

/// What of a surface describes a vertex.
struct ShotBall {
  double radius = 0;  ///< mesh units
  /// Vertices whose normal has a smaller cosine with the center's are left out:
  /// a scan from one side does not have them.
  double least_cosine = -2;
};

/// Returns SHOT descriptors (Tombari, Salti, Di Stefano: Unique Signatures of
/// Histograms for Local Surface Description, ECCV 2010) of some vertices, one a
/// column of length 1: how the surface nearer than ball.radius turns, seen from
/// a frame of its own. 8 azimuth x 2 elevation x 2 distance cells, in each a
/// histogram of the cosine between normals and the frame's z axis in 11 bins,
/// all shared out linearly among neighboring bins.
///
/// Unlike the original it weighs vertices by area, so that the density of a
/// mesh does not show, and looks at the connected part of the ball only, so
/// that touching limbs do not. Moving a shape rigidly changes nothing; mirror
/// images differ.
///
/// CANCELLED after `stop`. Time O(vertices vertices-in-a-ball).
absl::StatusOr<PointColumns> ShotDescriptors(
    const DescribedSurface& surface, absl::Span<const VertexIndex> vertices,
    const ShotBall& ball, const std::stop_token& stop);

}  // namespace isomatch
