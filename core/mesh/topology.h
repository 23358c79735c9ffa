#pragma once

#include <cstdint>
#include <vector>

#include "core/mesh/triangle_mesh.h"

namespace isomatch {

/// The faces at each edge.
///
/// Time and memory O(m).
class EdgeFaces {
 public:
  /// REQUIRES: no more faces than ValidateMesh lets pass, so that each side has
  /// a number.
  explicit EdgeFaces(const Faces& faces);

  /// Side `corner` of face `face` runs from its vertex `corner` to the next.
  struct Side {
    VertexIndex face;
    int corner;
  };

  /// Returns the side of the other face at this edge when exactly two faces
  /// meet there; {kNoVertex, 0} at a boundary or a non-manifold edge.
  Side Opposite(VertexIndex face, int corner) const {
    const SideIndex other = opposite_[3 * face + corner];
    if (other < 0) return {kNoVertex, 0};
    return {other / 3, other % 3};
  }

  /// True when no other face meets this side.
  bool IsBoundary(VertexIndex face, int corner) const {
    return opposite_[3 * face + corner] == kBoundary;
  }

  int boundary_edges() const { return boundary_edges_; }
  int nonmanifold_edges() const { return nonmanifold_edges_; }

 private:
  /// 3 face + corner.
  using SideIndex = std::int32_t;
  static constexpr SideIndex kBoundary = -1;
  static constexpr SideIndex kNonManifold = -2;

  std::vector<SideIndex> opposite_;  ///< of each side, or one of the above
  int boundary_edges_ = 0;
  int nonmanifold_edges_ = 0;
};

/// 1 for the vertices at edges of one face, and of three or more where
/// `nonmanifold`, else 0.
std::vector<char> RimVertices(const TriangleMesh& mesh, const EdgeFaces& edges,
                              bool nonmanifold = false);

/// Number of connected components (over shared vertices) and the component of
/// each vertex, numbered by smallest vertex.
struct Components {
  int count = 0;
  std::vector<int> of_vertex;
};
Components ConnectedComponents(const TriangleMesh& mesh);

/// Components of at least a twentieth of the largest one's area, by falling
/// area, ties by number.
std::vector<int> LargeComponents(const TriangleMesh& mesh,
                                 const Components& components);

/// The vertices at which two or more fans of faces meet that share no edge
/// there, by number. `edges`: of its faces, none of which repeats a vertex.
/// Time O(m).
std::vector<VertexIndex> NonManifoldVertices(const TriangleMesh& mesh,
                                             const EdgeFaces& edges);

}  // namespace isomatch
