#include "core/alignment/inverse_map.h"

#include <algorithm>

#include "core/base/parallel.h"
#include "core/base/status_macros.h"
#include "core/mesh/mesh_geometry.h"
#include "core/mesh/surface_samples.h"
#include "core/mesh/topology.h"

namespace isomatch {
namespace {

/// Weight of the difference of unit normals beside that of positions.
constexpr float kNormalWeight = 0.3f;
/// What lies farther from the laid surface than this, in mean edges, is not
/// under it; of what lies beside its rim a part of that.
constexpr double kMostGap = 2;
constexpr double kMostGapAtRim = 0.6;
/// Cosine between normals below which two points lie on different sides.
constexpr double kLeastCosine = 0.3;

/// Positions and normals, one vertex a column.
PointColumns Describe(const Positions& positions, const Positions& normals,
                      bool oriented) {
  PointColumns columns(6, positions.rows());
  columns.topRows(3) = positions.transpose().cast<float>();
  columns.bottomRows(3) =
      (oriented ? kNormalWeight : 0) * normals.transpose().cast<float>();
  return columns;
}

/// Edges of one face alone, by face and corner.
class Rim {
 public:
  explicit Rim(const TriangleMesh& mesh)
      : faces_(mesh.faces),
        edges_(mesh.faces),
        at_rim_(RimVertices(mesh, edges_)) {}

  /// Whether the point lies on one.
  bool Holds(const SurfacePoint& point) const {
    for (int corner = 0; corner < 3; ++corner) {
      // Opposite to the edge that begins at the corner.
      if (point.weights[(corner + 2) % 3] < kOnEdge &&
          edges_.IsBoundary(point.face, corner)) {
        return true;
      }
    }
    // Or at a vertex of one, whichever face was named.
    Eigen::Index corner = 0;
    return point.weights.maxCoeff(&corner) > 1 - kOnEdge &&
           at_rim_[faces_(point.face, corner)];
  }

 private:
  static constexpr double kOnEdge = 1e-6;
  const Faces& faces_;
  const EdgeFaces edges_;
  const std::vector<char> at_rim_;
};

/// Where vertices are that must not be found, in any unit of the area.
constexpr double kFarAway = 1e3;

/// The faces of a laid surface that lie on the other, and their numbers.
struct LaidFaces {
  Faces faces;
  std::vector<VertexIndex> numbers;
};

LaidFaces MatchedFaces(const LaidSurface& laid) {
  LaidFaces kept;
  const Faces& faces = laid.mesh.faces;
  for (VertexIndex f = 0; f < laid.mesh.num_faces(); ++f) {
    if (laid.matched.empty() ||
        (laid.matched[faces(f, 0)] && laid.matched[faces(f, 1)] &&
         laid.matched[faces(f, 2)])) {
      kept.numbers.push_back(f);
    }
  }
  kept.faces = faces(kept.numbers, Eigen::all);
  return kept;
}

}  // namespace

absl::StatusOr<InverseMap> InvertMap(const LaidSurface& laid,
                                     const GroundSurface& ground,
                                     const std::stop_token& stop) {
  const VertexIndex n = ground.mesh.num_vertices();
  InverseMap inverse = {std::vector<SurfacePoint>(n), std::vector<char>(n)};
  const LaidFaces kept = MatchedFaces(laid);
  if (kept.numbers.empty()) {
    for (SurfacePoint& point : inverse.points) point = {0, {1, 0, 0}};
    return inverse;
  }
  TriangleMesh placed = {laid.places, kept.faces};
  const VertexStars stars(placed);
  for (VertexIndex v = 0; v < placed.num_vertices(); ++v) {
    if (stars.SomeFaces(v).empty())
      placed.positions.row(v).setConstant(kFarAway);
  }
  const Positions normals = VertexNormals(placed);
  const PointColumns columns_ground =
      Describe(ground.mesh.positions, ground.normals, ground.oriented);
  const PointColumns columns_laid =
      Describe(placed.positions, normals, ground.oriented);
  ISOMATCH_ASSIGN_OR_RETURN(
      const VertexMap nearest,
      NearestOnSurface({ground.stars, ground.areas, columns_ground},
                       {stars, laid.areas, columns_laid}, stop));
  const Rim rim(placed);
  const double edge =
      std::max(MeanEdgeLength(laid.mesh), MeanEdgeLength(ground.mesh));
  ISOMATCH_RETURN_IF_ERROR(ParallelForVertices(n, stop, [&](VertexIndex v) {
    SurfacePoint& point = inverse.points[v];
    point = NearestOnFaces(placed, stars.SomeFaces(nearest[v]),
                           ground.mesh.positions.row(v));
    const double gap =
        (PositionOf(placed, point) - ground.mesh.positions.row(v)).norm();
    const double most = rim.Holds(point) ? kMostGapAtRim : kMostGap;
    const double cosine = normals.row(nearest[v]).dot(ground.normals.row(v));
    inverse.covered[v] =
        gap < most * edge && (!ground.oriented || cosine > kLeastCosine);
    point.face = kept.numbers[point.face];
  }));
  return inverse;
}

}  // namespace isomatch
