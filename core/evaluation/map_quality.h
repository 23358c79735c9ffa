#pragma once

#include <stop_token>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "core/base/vertex_index.h"
#include "core/geodesic/basis_points.h"
#include "core/mesh/triangle_mesh.h"

namespace isomatch {

/// What can be measured of a map without a truth. Lengths are in mesh units.
struct MapMeasures {
  /// For each vertex of X the median over the anchors a of |d_X(x, a) -
  /// d_Y(map(x), map(a))|: 0 for an isometry. A median, so that a few anchors
  /// whose own images are wrong do not count. -1 where the vertex, or every
  /// anchor, does not count.
  std::vector<float> distortions;
  /// Mean of that difference over all vertices and anchors.
  double geodesic_distortion = 0;
  /// Fraction of Y's area that is nearer to an image than two mean edges of the
  /// coarser mesh.
  double coverage = 0;
  /// Mean over X's area of |ln(area of a face's image / its area)|, no term
  /// above ln 1000.
  double area_distortion = 0;
};

/// A dense map, of which some vertices may not count.
struct MeasuredMap {
  /// The vertices of Y next to the images.
  absl::Span<const VertexIndex> y_from_x;
  /// n_X x 3: where on Y the vertices of X go.
  const Positions& images;
  /// Not 0 for the vertices of X that count; empty: all.
  absl::Span<const char> matched = {};
  bool Has(VertexIndex x) const { return matched.empty() || matched[x]; }
};

/// Measures a map between clean meshes of equal area. Distances between
/// components count as the largest finite one.
///
/// Anchors are the first 24, or fewer, of `basis_x`, farthest points of X whose
/// distance fields are there. CANCELLED after `stop`. Time O(n).
absl::StatusOr<MapMeasures> MeasureMap(const TriangleMesh& mesh_x,
                                       const BasisPoints& basis_x,
                                       const TriangleMesh& mesh_y,
                                       const MeasuredMap& map,
                                       const std::stop_token& stop);

}  // namespace isomatch
