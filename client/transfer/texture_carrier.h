#pragma once

#include <stop_token>

#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "client/files/mesh_file.h"
#include "core/mesh/triangle_mesh.h"
#include "core/pipeline/precise_point.h"

namespace isomatch {

/// Texture coordinates carried from Y to X.
struct CarriedTexture {
  MeshTexture texture;
  /// Faces of X without any: a corner lies nowhere, or where Y has none.
  int faces_without = 0;
  /// Faces of X that lie across a seam of Y.
  int faces_on_seams = 0;
};

/// Returns Y's texture coordinates for the corners of X's faces; materials and
/// libraries are Y's.
///
/// A seam of Y is an edge whose two faces have different texture coordinates
/// there, or different materials. All three corners of a face of X take theirs
/// from faces of Y that hang together without crossing a seam, so that no face
/// spans the picture from one side to the other:
///
/// 1. From each face of Y on which a corner lies, faces are visited over edges
///    that are no seams, as far as the face of X reaches, but on no way much
///    longer than that over seams: around a limb is none.
/// 2. Of these sheets the one with most corners of the face wins; then the one
///    that comes nearest to the others, then the one that was reached over
///    fewest edges, then the first.
/// 3. A corner that lies elsewhere takes the coordinates of the nearest point
///    of the sheet, at its rim: so all coordinates are some that Y has.
///
/// `places` has one entry for each vertex of X, on a face of Y, as vertices[i]
/// of Y. Vertices of Y that a texture seam doubles count as one. CANCELLED
/// after `stop`. Time O(faces of X times faces of Y within reach of each).
absl::StatusOr<CarriedTexture> CarryTexture(
    const TriangleMesh& mesh_x, const TriangleMesh& mesh_y,
    const MeshTexture& texture_y, absl::Span<const PrecisePoint> places,
    const std::stop_token& stop);

}  // namespace isomatch
