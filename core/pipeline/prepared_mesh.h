#pragma once

#include <functional>
#include <memory>
#include <stop_token>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/geodesic/basis_points.h"
#include "core/geodesic/distance_field_solver.h"
#include "core/mesh/triangle_mesh.h"
#include "core/mesh/vertex_stars.h"

namespace isomatch {

/// One mesh as the method works on it, and the way back to the user's
/// numbering.
struct WorkingMesh {
  /// Clean (core/mesh/clean_mesh.h), only the components that matter, centred
  /// at the origin and of surface area 1, renumbered in SpatialOrder.
  TriangleMesh mesh;
  Positions normals;
  VertexStars stars;
  /// Working vertex that stands for each of the user's: its own, or for one on
  /// a left-out component the nearest in space; kNoVertex on no face.
  VertexMap working_from_user;
  /// The user's vertex of each working one.
  VertexMap user_from_working;
  /// Surface area before scaling, squared mesh units.
  double area = 0;
  bool oriented = true;
  std::vector<std::string> warnings;
};

/// Returns `mesh` made ready: cleaned, without components of less than a
/// twentieth of the largest one's area, normalised.
/// REQUIRES: ValidateMesh(mesh). Time O(n log n).
absl::StatusOr<WorkingMesh> MakeWorkingMesh(const TriangleMesh& mesh,
                                            const std::stop_token& stop);

/// What Section 3.1 precomputes of one shape. Unit: sqrt(area).
struct GeodesicHash {
  /// Farthest points: the first basis.num_points() of them are the basis
  /// points; at least as many as asked for, or all vertices.
  std::vector<VertexIndex> farthest_points;
  BasisPoints basis;
};

/// Samples max(sqrt(n), `num_points`) farthest points and computes the distance
/// fields of the basis points among them.
absl::StatusOr<GeodesicHash> HashGeodesics(
    const WorkingMesh& working, int num_points,
    const std::function<void(double)>& progress, const std::stop_token& stop);

/// The environments of the basis points, of all vertices (Section 3.1).
Environments AllEnvironments(const BasisPoints& basis);

/// Vertices of a pool: the first `pool_size` farthest points (all vertices when
/// 0), then those of `extra` that are not among them.
std::vector<VertexIndex> PoolVertices(const GeodesicHash& hash, int pool_size,
                                      const std::vector<VertexIndex>& extra);

}  // namespace isomatch
