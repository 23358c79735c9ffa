#pragma once

#include <vector>

#include <Eigen/Core>

#include "core/mesh/triangle_mesh.h"

namespace isomatch {

/// A closed manifold triangle mesh that can be changed edge by edge.
///
/// Half-edge 3 f + i runs from corner i of face f to the next corner; its twin
/// is the same edge in the neighboring face. Faces and vertices that are
/// removed stay as holes in the numbering until ToMesh.
class EditableMesh {
 public:
  /// REQUIRES: every edge of `mesh` is in exactly two faces that traverse it in
  /// opposite directions, and every vertex has one fan of faces.
  explicit EditableMesh(const TriangleMesh& mesh);

  int num_half_edges() const { return static_cast<int>(origin_.size()); }
  int num_vertices() const { return live_vertices_; }
  /// Vertices ever made; the range of vertex numbers.
  int end_vertex() const { return static_cast<int>(points.size()); }

  bool is_live(int half_edge) const { return origin_[Index(half_edge)] >= 0; }
  bool is_live_vertex(int vertex) const { return out_[Index(vertex)] >= 0; }
  int Next(int h) const { return h % 3 == 2 ? h - 2 : h + 1; }
  int Previous(int h) const { return h % 3 == 0 ? h + 2 : h - 1; }
  int Twin(int h) const { return twin_[Index(h)]; }
  int Origin(int h) const { return origin_[Index(h)]; }
  int Tip(int h) const { return Origin(Next(h)); }
  /// The corner across the edge, in the half-edge's own face.
  int Opposite(int h) const { return Origin(Previous(h)); }
  const Eigen::Vector3d& Point(int vertex) const {
    return points[Index(vertex)];
  }
  double SquaredLength(int h) const {
    return (Point(Tip(h)) - Point(Origin(h))).squaredNorm();
  }

  /// Calls visit(h) for each half-edge that leaves `vertex`.
  template <typename Visit>
  void ForEachOut(int vertex, const Visit& visit) const {
    const int first = out_[Index(vertex)];
    int h = first;
    do {
      visit(h);
      h = Twin(Previous(h));
    } while (h != first);
  }
  int Valence(int vertex) const;

  /// Puts a vertex at `point` on the edge and joins it to both opposite
  /// corners. Returns the vertex.
  int Split(int h, const Eigen::Vector3d& point);

  /// True when the other diagonal of the two faces is not an edge yet.
  bool CanFlip(int h) const;
  /// Replaces the edge by the other diagonal. REQUIRES: CanFlip(h).
  void Flip(int h);

  /// True when moving Origin(h) into Tip(h) keeps the mesh a closed manifold
  /// and turns no face by more than 60 degrees.
  bool CanCollapse(int h) const;
  /// Removes Origin(h) and both faces of the edge. REQUIRES: CanCollapse(h).
  void Collapse(int h);

  /// The live part, vertices renumbered in order.
  TriangleMesh ToMesh() const;

  /// By vertex number; free to change.
  std::vector<Eigen::Vector3d> points;

 private:
  static std::size_t Index(int i) { return static_cast<std::size_t>(i); }
  int NewFace();
  void SetFace(int face, int a, int b, int c);
  void Link(int h, int other);
  bool TurnsNoFace(int h) const;

  std::vector<int> origin_;  // by half-edge, -1 in a removed face
  std::vector<int> twin_;    // by half-edge
  std::vector<int> out_;     // by vertex: one that leaves it, -1 if removed
  int live_vertices_ = 0;
};

}  // namespace isomatch
