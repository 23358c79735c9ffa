#pragma once

#include <array>
#include <utility>
#include <vector>

#include "core/base/vertex_index.h"
#include "core/mesh/precise_point.h"
#include "core/mesh/surface_point.h"
#include "core/mesh/triangle_mesh.h"

namespace isomatch {

/// Finds the faces of a mesh by their vertices. Thread-safe.
class FaceFinder {
 public:
  /// Keeps a reference to `mesh`. Time O(m log m), memory 40 bytes a face.
  explicit FaceFinder(const TriangleMesh& mesh);

  /// Returns the point on the mesh's own faces, its weights in their order:
  ///
  /// 1. on the face that has these vertices, the first of several;
  /// 2. else on one whose vertices lie at the same positions, since the server
  ///    welds seams and names one vertex of those that coincide in single
  ///    precision;
  /// 3. else at the vertex of the largest weight, on the first face there.
  ///
  /// No face for no point, or for a vertex on no face.
  SurfacePoint Find(const PrecisePoint& point) const;

 private:
  using Corners = std::array<VertexIndex, 3>;

  /// Corners, which are sorted themselves, and face; sorted.
  using Table = std::vector<std::pair<Corners, VertexIndex>>;

  /// The table of the mesh's faces after their vertices were renamed.
  Table MakeTable(const VertexMap& new_from_old) const;
  static VertexIndex Lookup(const Table& table, Corners corners);
  Corners CornersOf(VertexIndex face) const;
  SurfacePoint AtHeaviestVertex(const PrecisePoint& point) const;

  const TriangleMesh& mesh_;
  /// The vertex itself.
  VertexMap same_;
  /// The first vertex at the same position.
  VertexMap first_;
  Table by_vertices_;
  Table by_positions_;
  /// The first face at each such vertex; kNoVertex for none.
  std::vector<VertexIndex> face_at_;
};

}  // namespace isomatch
