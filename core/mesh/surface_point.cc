#include "core/mesh/surface_point.h"

#include <algorithm>
#include <iterator>
#include <limits>

#include <Eigen/Geometry>

namespace isomatch {
namespace {

using Corners = Eigen::Matrix3d;  ///< one a row

/// Weights of the nearest point on the side between two corners.
Eigen::Vector3d OnSide(const Corners& corners, int from, int to,
                       const Eigen::RowVector3d& position) {
  const Eigen::RowVector3d side = corners.row(to) - corners.row(from);
  const double squared = side.squaredNorm();
  const double t =
      squared > 0
          ? std::clamp((position - corners.row(from)).dot(side) / squared, 0.0,
                       1.0)
          : 0.0;
  Eigen::Vector3d weights = Eigen::Vector3d::Zero();
  weights[from] = 1 - t;
  weights[to] = t;
  return weights;
}

/// Weights of the foot of the perpendicular on the plane of a face; false when
/// it lies outside the face.
bool InFace(const Corners& corners, const Eigen::RowVector3d& position,
            Eigen::Vector3d* weights) {
  const Eigen::RowVector3d u = corners.row(1) - corners.row(0);
  const Eigen::RowVector3d v = corners.row(2) - corners.row(0);
  const Eigen::RowVector3d w = position - corners.row(0);
  const Eigen::RowVector3d normal = u.cross(v);
  const double squared = normal.squaredNorm();
  if (!(squared > 0)) return false;
  const double b = w.cross(v).dot(normal) / squared;
  const double c = u.cross(w).dot(normal) / squared;
  *weights = {1 - b - c, b, c};
  return weights->minCoeff() >= 0;
}

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
  return *std::min_element(
      std::begin(on_sides), std::end(on_sides),
      [&](const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
        return p.SquaredDistance(a.x(), a.y()) <
               p.SquaredDistance(b.x(), b.y());
      });
}

}  // namespace

Eigen::RowVector3d PositionOf(const TriangleMesh& mesh,
                              const SurfacePoint& point) {
  return Interpolated(mesh.positions, mesh.faces, point);
}

SurfacePoint NearestOnFaces(const TriangleMesh& mesh,
                            absl::Span<const VertexIndex> faces,
                            const Eigen::RowVector3d& position) {
  SurfacePoint nearest;
  double least = std::numeric_limits<double>::infinity();
  for (const VertexIndex face : faces) {
    Corners corners;
    for (int i = 0; i < 3; ++i) {
      corners.row(i) = mesh.positions.row(mesh.faces(face, i));
    }
    const auto offer = [&](const Eigen::Vector3d& weights) {
      const double squared =
          (weights.transpose() * corners - position).squaredNorm();
      if (squared >= least && nearest.face != kNoVertex) return;
      least = squared;
      nearest = {face, weights};
    };
    Eigen::Vector3d weights;
    if (InFace(corners, position, &weights)) {
      offer(weights);
      continue;
    }
    for (int i = 0; i < 3; ++i) {
      offer(OnSide(corners, i, (i + 1) % 3, position));
    }
  }
  return nearest;
}

SurfacePoint NearestOnFaces(const Faces& mesh_faces,
                            absl::Span<const VertexIndex> faces,
                            const PointColumns& columns,
                            const Eigen::Ref<const Eigen::VectorXf>& wanted) {
  SurfacePoint nearest;
  double least = std::numeric_limits<double>::infinity();
  for (const VertexIndex face : faces) {
    // In double: what sets slivers apart from lines is lost in single products.
    const Eigen::VectorXd corner =
        columns.col(mesh_faces(face, 0)).cast<double>();
    const Eigen::VectorXd u =
        columns.col(mesh_faces(face, 1)).cast<double>() - corner;
    const Eigen::VectorXd v =
        columns.col(mesh_faces(face, 2)).cast<double>() - corner;
    const Eigen::VectorXd w = wanted.cast<double>() - corner;
    const TriangleProducts products = {u.squaredNorm(), u.dot(v),
                                       v.squaredNorm(), u.dot(w),
                                       v.dot(w),        w.squaredNorm()};
    const Eigen::Vector2d st = NearestInTriangle(products);
    const double squared = products.SquaredDistance(st.x(), st.y());
    if (squared >= least && nearest.face != kNoVertex) continue;
    least = squared;
    nearest = {face, {1 - st.x() - st.y(), st.x(), st.y()}};
  }
  return nearest;
}

}  // namespace isomatch
