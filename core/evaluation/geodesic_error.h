#pragma once

#include <array>
#include <stop_token>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "core/base/vertex_index.h"
#include "core/geodesic/distance_field_solver.h"
#include "core/mesh/clean_mesh.h"
#include "core/mesh/precise_point.h"
#include "core/mesh/surface_point.h"
#include "core/mesh/triangle_mesh.h"

namespace isomatch {

/// Thresholds, as fractions of the diameter, of the cumulative curve.
inline constexpr std::array<double, 5> kErrorThresholds = {.01, .02, .05, .1,
                                                           .25};

/// Error of a map against the truth, Princeton protocol (Kim et al. 2011):
/// geodesic distance on Y between found and true vertex.
struct GeodesicError {
  /// Vertices of X with a truth, and those of them the map leaves out.
  int evaluated = 0;
  int unmatched = 0;
  /// Mean over the matched ones, as a fraction of the diameter and of
  /// sqrt(area) of Y.
  double mean_over_diameter = 0;
  double mean_over_sqrt_area = 0;
  /// Largest, as a fraction of the diameter.
  double max_over_diameter = 0;
  /// Fraction of the matched vertices within each of kErrorThresholds.
  std::array<double, kErrorThresholds.size()> within = {};
  /// Error at each vertex of X, as a fraction of the diameter; -1 where there
  /// is no truth or no match.
  std::vector<float> of_vertex;
  /// Geodesic diameter and square root of the area of Y, mesh units.
  double diameter = 0;
  double sqrt_area = 0;
};

/// Measures maps into one mesh Y.
///
/// The diameter is the largest distance found from 32 farthest points: a lower
/// bound that in practice is exact to a percent (the ends of the diameter are
/// extremities, which farthest point sampling visits first).
class GeodesicErrorMeter {
 public:
  /// REQUIRES: ValidateMesh(mesh_y).
  explicit GeodesicErrorMeter(const TriangleMesh& mesh_y);

  double diameter() const { return diameter_; }
  double sqrt_area() const { return sqrt_area_; }

  /// Compares `found` with `truth`, both as y_from_x; entries of `truth` that
  /// are kNoVertex are left out. Distances between vertices of different
  /// components count as the diameter.
  ///
  /// INVALID_ARGUMENT: unequal sizes, an index out of range, nothing to
  /// compare.
  absl::StatusOr<GeodesicError> Measure(absl::Span<const VertexIndex> found,
                                        absl::Span<const VertexIndex> truth,
                                        const std::stop_token& stop = {}) const;

  /// The same for places between vertices, on `faces_y` of the mesh. The
  /// distance to a place is the shortest way over the corners of its face, or
  /// over one of its edges on the straight line from the virtual source that
  /// the distances of the edge's ends have in the plane (as
  /// DistanceFieldSolver): exact beside the source.
  absl::StatusOr<GeodesicError> Measure(const Faces& faces_y,
                                        absl::Span<const SurfacePoint> found,
                                        absl::Span<const VertexIndex> truth,
                                        const std::stop_token& stop = {}) const;

 private:
  absl::StatusOr<GeodesicError> MeasurePlaces(
      absl::Span<const PrecisePoint> found, absl::Span<const VertexIndex> truth,
      const std::stop_token& stop) const;

  const CleanMesh clean_;
  const DistanceFieldSolver solver_;
  const double diameter_;
  const double sqrt_area_;
};

}  // namespace isomatch
