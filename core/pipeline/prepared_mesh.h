#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/descriptor/nearby_match.h"
#include "core/geodesic/basis_points.h"
#include "core/geodesic/distance_field_solver.h"
#include "core/mesh/clean_mesh.h"
#include "core/mesh/surface_point.h"
#include "core/mesh/triangle_mesh.h"
#include "core/mesh/vertex_stars.h"
#include "core/pipeline/match_options.h"
#include "core/pipeline/memory_plan.h"
#include "core/spectral/cotan_laplacian.h"
#include "core/spectral/spectral_basis.h"

namespace isomatch {

/// One mesh as the method works on it, and the way back to the user's
/// numbering.
struct WorkingMesh {
  /// Clean (core/mesh/clean_mesh.h), only the components that matter, centered
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

/// A mesh on fewer of its vertices.
struct CoarseLevel {
  /// As any working mesh, from and to the user's vertices.
  WorkingMesh working;
  VertexMap full_from_coarse;
  /// Of each vertex of the full mesh the nearest point of this one.
  std::vector<SurfacePoint> embedding;
};

/// Returns a mesh made ready: without components of less than a twentieth of
/// the largest one's area, normalized. Time O(n log n).
absl::StatusOr<WorkingMesh> MakeWorkingMesh(CleanMesh clean,
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

/// All that is known of one shape before it meets another.
struct PreparedMesh {
  WorkingMesh full;
  /// Where `full` has many vertices: what is solved on in its place.
  std::optional<CoarseLevel> coarse;

  // What was computed on solved().

  GeodesicHash hash;
  CotanLaplacian laplacian;
  SpectralBasis spectral;     ///< empty where the options need none
  Eigen::VectorXd curvature;  ///< smoothed mean curvature, or 0
  ShapeDescriptors descriptors;
  double descriptor_radius = 0;  ///< sqrt(area); 0 without descriptors

  const WorkingMesh& solved() const { return coarse ? coarse->working : full; }
};

/// How large it is, and how large what is solved on.
DecimatedSize SizesOf(const PreparedMesh& prepared);

/// Whether a mesh of that many vertices is decimated: more than
/// options.solved_vertices by a tenth, unless that is 0.
bool IsDecimated(std::int64_t num_vertices, const MatchOptions& options);

/// Fills full and coarse. CANCELLED after `stop`. Time O(n log n).
absl::Status PrepareSurface(CleanMesh mesh, const MatchOptions& options,
                            const std::stop_token& stop,
                            PreparedMesh* prepared);

/// Vertices of a side that are described: many more than a functional map of
/// alignment_basis eigenfunctions has coefficients a row.
inline constexpr std::int64_t kDescribedVertices = 6000;

/// The solved surface, as descriptors see it. Refers to `prepared`.
DescribedSurface SurfaceOf(const PreparedMesh& prepared);

/// Describes the solved vertices, where the options and the orientation want
/// that. CANCELLED after `stop`.
absl::Status Describe(const MatchOptions& options, const std::stop_token& stop,
                      PreparedMesh* prepared);

/// Multiplies all lengths of a shape by `factor`, so that two shapes have one
/// unit: sqrt(area) of one of them. Smoothed curvature, which speaks of
/// features of a size, is computed anew; descriptors are dropped, whose radius
/// is told: parts have others. Errors as PrepareMeshes.
absl::Status Rescale(double factor, const MatchOptions& options,
                     PreparedMesh* prepared);

/// Mirrors a shape in space: intrinsically it stays the same. Its faces are
/// turned over, so that normals stay outward. Its descriptors change, and have
/// to be made anew.
void Reflect(PreparedMesh* prepared);

/// The environments of the basis points, of all vertices (Section 3.1).
Environments AllEnvironments(const BasisPoints& basis);

/// Vertices of a pool: the first `pool_size` farthest points (all vertices when
/// 0), then those of `extra` that are not among them.
std::vector<VertexIndex> PoolVertices(const GeodesicHash& hash, int pool_size,
                                      const std::vector<VertexIndex>& extra);

}  // namespace isomatch
