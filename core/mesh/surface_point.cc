#include "core/mesh/surface_point.h"

#include <algorithm>
#include <limits>

namespace isomatch {
namespace {

/// Squared distances from w to the points s u + t v of a triangle with sides u
/// and v from its first corner, by the products of these alone.
struct TriangleProducts {
  double uu, uv, vv, uw, vw, ww;

  double SquaredDistance(double s, double t) const {
    return ww - 2 * (s * uw + t * vw) + s * s * uu + 2 * s * t * uv +
           t * t * vv;
  }
};

/// Part of the way along a side where `along` is least; 0 on sides without
/// length.
double OnSegment(double along, double squared) {
  return squared > 0 ? std::clamp(along / squared, 0.0, 1.0) : 0.0;
}

/// (s, t) of the nearest point of the triangle.
Eigen::Vector2d NearestInTriangle(const TriangleProducts& p) {
  constexpr double kLeastDeterminant = 1e-12;
  const double determinant = p.uu * p.vv - p.uv * p.uv;
  if (determinant > kLeastDeterminant * p.uu * p.vv) {
    const double s = (p.uw * p.vv - p.vw * p.uv) / determinant;
    const double t = (p.vw * p.uu - p.uw * p.uv) / determinant;
    if (s >= 0 && t >= 0 && s + t <= 1) return {s, t};
  }
  const double across =
      OnSegment(p.vw - p.uv - p.uw + p.uu, p.uu - 2 * p.uv + p.vv);
  const Eigen::Vector2d on_sides[] = {{OnSegment(p.uw, p.uu), 0},
                                      {0, OnSegment(p.vw, p.vv)},
                                      {1 - across, across}};
  int best = 0;
  double least = p.SquaredDistance(on_sides[0].x(), on_sides[0].y());
  for (int side = 1; side < 3; ++side) {
    const double squared =
        p.SquaredDistance(on_sides[side].x(), on_sides[side].y());
    if (!(squared < least)) continue;
    least = squared;
    best = side;
  }
  return on_sides[best];
}

/// Of faces whose corners are where corner_of(face, 0), 1, 2 say.
template <typename Point, typename CornerOf>
SurfacePoint NearestAmong(absl::Span<const VertexIndex> faces,
                          const CornerOf& corner_of, const Point& wanted) {
  SurfacePoint nearest;
  double least = std::numeric_limits<double>::infinity();
  for (const VertexIndex face : faces) {
    const Point corner = corner_of(face, 0);
    const Point u = corner_of(face, 1) - corner;
    const Point v = corner_of(face, 2) - corner;
    const Point w = wanted - corner;
    const TriangleProducts products = {u.squaredNorm(), u.dot(v),
                                       v.squaredNorm(), u.dot(w),
                                       v.dot(w),        w.squaredNorm()};
    const Eigen::Vector2d st = NearestInTriangle(products);
    const double squared = products.SquaredDistance(st.x(), st.y());
    if (squared >= least && nearest.face != kNoVertex) continue;
    least = squared;
    nearest = {face, {std::max(0.0, 1 - st.x() - st.y()), st.x(), st.y()}};
  }
  return nearest;
}

}  // namespace

Eigen::RowVector3d PositionOf(const TriangleMesh& mesh,
                              const SurfacePoint& point) {
  return Interpolated(mesh.positions, mesh.faces, point);
}

VertexIndex NearestCorner(const Faces& faces, const SurfacePoint& point) {
  Eigen::Index corner = 0;
  point.weights.maxCoeff(&corner);
  return faces(point.face, corner);
}

SurfacePoint NearestOnFaces(const TriangleMesh& mesh,
                            absl::Span<const VertexIndex> faces,
                            const Eigen::RowVector3d& position) {
  return NearestAmong<Eigen::RowVector3d>(
      faces,
      [&](VertexIndex face, int corner) {
        return mesh.positions.row(mesh.faces(face, corner));
      },
      position);
}

SurfacePoint NearestOnFaces(const Faces& mesh_faces,
                            absl::Span<const VertexIndex> faces,
                            const PointColumns& columns,
                            const Eigen::Ref<const Eigen::VectorXf>& wanted) {
  // In double: what sets slivers apart from lines is lost in single products.
  return NearestAmong<Eigen::VectorXd>(
      faces,
      [&](VertexIndex face, int corner) {
        return columns.col(mesh_faces(face, corner)).cast<double>();
      },
      wanted.cast<double>());
}

}  // namespace isomatch
