#pragma once

#include <stop_token>

#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "client/files/mesh_file.h"
#include "core/mesh/precise_point.h"
#include "core/mesh/triangle_mesh.h"

namespace isomatch {

/// Texture coordinates carried from Y to X.
struct CarriedTexture {
  MeshTexture texture;
  /// Faces of X that get no coordinates: a corner has no place on Y, or Y has
  /// no coordinates at any corner.
  int faces_without = 0;
  /// Faces of X that lie across a seam of Y.
  int faces_on_seams = 0;
};

/// Returns Y's texture coordinates for the corners of X's faces; materials and
/// libraries are Y's.
///
/// A seam of Y is an edge whose two faces have different texture coordinates
/// there, or different materials. All three corners of a face of X take theirs
/// from one sheet: faces of Y that are connected without crossing a seam. So no
/// face spans the picture from one side to the other.
///
/// 1. From each face of Y on which a corner lies, a sheet grows over edges that
///    are not seams, as far as the face of X reaches. It follows no way much
///    longer than the way across seams, since that would lead around a limb.
/// 2. The sheet with the most corners of the face wins. Among equal ones it is
///    the one nearest to the other corners, then the one whose corners were
///    reached over the fewest edges, then the first.
/// 3. A corner that is not on the sheet takes the coordinates of the nearest
///    point of the sheet, at its rim. So X gets only coordinates that Y has.
///
/// `places` has one entry for each vertex of X: the vertices of a face of Y,
/// and their weights. Vertices of Y that a texture seam doubles count as one.
/// CANCELLED after `stop`. Time O(faces of X times faces of Y within reach of
/// each).
absl::StatusOr<CarriedTexture> CarryTexture(
    const TriangleMesh& mesh_x, const TriangleMesh& mesh_y,
    const MeshTexture& texture_y, absl::Span<const PrecisePoint> places,
    const std::stop_token& stop);

}  // namespace isomatch
