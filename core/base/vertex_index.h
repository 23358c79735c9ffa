#pragma once

#include <cstdint>
#include <vector>

namespace isomatch {

/// Index of a vertex of one mesh, 0-based.
using VertexIndex = std::int32_t;

/// "No vertex": the image of a vertex that has no match.
inline constexpr VertexIndex kNoVertex = -1;

/// Vertex map between two meshes. `y_from_x[i]` is the vertex of Y that vertex
/// i of X corresponds to, or kNoVertex.
using VertexMap = std::vector<VertexIndex>;

/// One match: vertex x of X corresponds to vertex y of Y.
struct VertexMatch {
  VertexIndex x;
  VertexIndex y;
  bool operator==(const VertexMatch&) const = default;
};

}  // namespace isomatch
