#pragma once

#include <Eigen/Core>

#include "absl/types/span.h"
#include "core/base/nearest_columns.h"
#include "core/mesh/triangle_mesh.h"

namespace isomatch {

/// A point on the surface of a mesh, between the vertices of a face.
struct SurfacePoint {
  /// kNoVertex for no point.
  VertexIndex face = kNoVertex;
  /// Barycentric coordinates: weights of the face's three vertices in its
  /// order, each in [0, 1], sum 1.
  Eigen::Vector3d weights = Eigen::Vector3d::Zero();
};

/// The mean of three rows of `values`, one a vertex, weighted as the point is.
/// REQUIRES: point.face >= 0.
template <typename Values>
auto Interpolated(const Values& values, const Faces& faces,
                  const SurfacePoint& point) {
  return (point.weights[0] * values.row(faces(point.face, 0)) +
          point.weights[1] * values.row(faces(point.face, 1)) +
          point.weights[2] * values.row(faces(point.face, 2)))
      .eval();
}

/// Where the point is, mesh units. REQUIRES: point.face >= 0.
Eigen::RowVector3d PositionOf(const TriangleMesh& mesh,
                              const SurfacePoint& point);

/// The vertex of the face at which the point has the largest weight, ties by
/// order. REQUIRES: point.face >= 0.
VertexIndex NearestCorner(const Faces& faces, const SurfacePoint& point);

/// Returns the point nearest to `position` on any of `faces`, ties by order.
/// Degenerate faces count as their edges. REQUIRES: at least one face.
SurfacePoint NearestOnFaces(const TriangleMesh& mesh,
                            absl::Span<const VertexIndex> faces,
                            const Eigen::RowVector3d& position);

/// The same where vertices have places in another space, one a column, linear
/// on each face: the point nearest to `wanted` there.
SurfacePoint NearestOnFaces(const Faces& mesh_faces,
                            absl::Span<const VertexIndex> faces,
                            const PointColumns& columns,
                            const Eigen::Ref<const Eigen::VectorXf>& wanted);

}  // namespace isomatch
