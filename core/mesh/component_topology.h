#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "core/mesh/triangle_mesh.h"

namespace isomatch {

/// What kind of surface one connected component is.
struct ComponentTopology {
  VertexIndex vertices = 0;
  VertexIndex faces = 0;
  /// Squared mesh units.
  double area = 0;
  /// Closed rows of edges that have one face only.
  int boundary_loops = 0;
  /// Vertices - edges + faces.
  std::int64_t euler_characteristic = 0;
  /// At most two faces meet at each edge, and one fan of them at each vertex.
  bool is_manifold = true;
  /// Neighboring faces agree in orientation.
  bool is_oriented = true;

  /// Number of handles, (2 - euler_characteristic - boundary_loops) / 2; none
  /// where the surface is not manifold or not oriented.
  std::optional<std::int64_t> Genus() const;
};

/// Returns the components (over shared vertices) of `mesh` that have faces, by
/// falling area, ties by smallest vertex. REQUIRES: a clean mesh
/// (core/mesh/clean_mesh.h). Time O(m log m).
std::vector<ComponentTopology> DescribeComponents(const TriangleMesh& mesh);

}  // namespace isomatch
