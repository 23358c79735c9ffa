#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "client/c/isomatch.h"
#include "core/base/vertex_index.h"
#include "core/mesh/precise_point.h"
#include "core/mesh/triangle_mesh.h"

namespace isomatch {

/// A caller's isomatch_mapped_pair, checked.
struct MappedMeshes {
  TriangleMesh x;
  TriangleMesh y;
  VertexMap y_from_x;
  /// Of each vertex of X; empty when the caller has no precise map.
  std::vector<PrecisePoint> precise;

  /// `precise`, else the vertices of the map: each three times, weight 1 for
  /// the first.
  std::vector<PrecisePoint> Places() const;
};

/// INVALID_ARGUMENT, naming field and entry: a mesh that CopyOf refuses, a
/// vertex that Y does not have, weights that are not of [0, 1] with sum 1.
absl::StatusOr<MappedMeshes> MappedMeshesOf(const isomatch_mapped_pair& pair);

}  // namespace isomatch
