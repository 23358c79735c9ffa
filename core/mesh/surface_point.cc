#include "core/mesh/surface_point.h"

#include <algorithm>
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

}  // namespace

Eigen::RowVector3d PositionOf(const TriangleMesh& mesh,
                              const SurfacePoint& point) {
  Eigen::RowVector3d position = Eigen::RowVector3d::Zero();
  for (int corner = 0; corner < 3; ++corner) {
    position += point.weights[corner] *
                mesh.positions.row(mesh.faces(point.face, corner));
  }
  return position;
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

}  // namespace isomatch
