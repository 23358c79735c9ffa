#pragma once

#include <cstdint>
#include <stop_token>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "client/files/vertex_colors.h"
#include "core/mesh/precise_point.h"
#include "core/mesh/triangle_mesh.h"

namespace isomatch {

// What is known of Y's vertices, carried to those of X. `places` says where
// each vertex of X lies on Y; vertices[0] is kNoVertex for nowhere.

/// Vertices of X that lie nowhere.
int CountUnmatched(absl::Span<const PrecisePoint> places);

/// Colors, interpolated on faces; kNoColor for vertices that lie nowhere.
Colors CarryColors(const Colors& colors_y,
                   absl::Span<const PrecisePoint> places);

/// The label of the vertex of Y that is nearest, by weight, the first of equal
/// ones; never a mean. `missing` for vertices that lie nowhere.
std::vector<std::int64_t> CarryLabels(absl::Span<const std::int64_t> labels_y,
                                      absl::Span<const PrecisePoint> places,
                                      std::int64_t missing);

/// A landmark of Y on X.
struct CarriedLandmark {
  /// kNoVertex when no vertex of X lies on the landmark's component of Y.
  VertexIndex x = kNoVertex;
  /// On Y, from the landmark to where x lies, mesh units.
  double distance = 0;
};

/// The vertex of X that lies nearest to each landmark, measured along Y's
/// surface. Of several at the same distance, as there are where X is finer than
/// Y and the map names vertices, the one nearest to their middle in space; of
/// those the first.
///
/// REQUIRES: every landmark is on a face of Y. CANCELLED after `stop`. Time
/// O(landmarks (n_X + n_Y)).
absl::StatusOr<std::vector<CarriedLandmark>> CarryLandmarks(
    absl::Span<const VertexIndex> landmarks_y, const TriangleMesh& mesh_x,
    const TriangleMesh& mesh_y, absl::Span<const PrecisePoint> places,
    const std::stop_token& stop);

/// Where a point of Y lies on X between its vertices: the point of the faces
/// within two edges of vertex `x`, whose image on Y, linear on each of them, is
/// nearest to `position_y`. Faces with a vertex that lies nowhere have no
/// image; without any other it is the vertex.
///
/// REQUIRES: x >= 0. Time O(faces of X).
Eigen::RowVector3d PointOnX(const Eigen::RowVector3d& position_y, VertexIndex x,
                            const TriangleMesh& mesh_x,
                            const TriangleMesh& mesh_y,
                            absl::Span<const PrecisePoint> places);

}  // namespace isomatch
