#pragma once

#include <cstdint>
#include <vector>

#include "absl/types/span.h"
#include "core/mesh/triangle_mesh.h"

namespace isomatch {

/// The faces at each vertex and the vertices it shares an edge with.
///
/// Time and memory O(m).
class VertexStars {
 public:
  VertexStars() = default;
  explicit VertexStars(const TriangleMesh& mesh);

  /// By increasing face.
  absl::Span<const VertexIndex> Faces(VertexIndex v) const {
    return Slice(faces_, first_face_, v);
  }
  /// By increasing vertex, each once.
  absl::Span<const VertexIndex> Neighbors(VertexIndex v) const {
    return Slice(neighbors_, first_neighbor_, v);
  }

 private:
  static absl::Span<const VertexIndex> Slice(
      const std::vector<VertexIndex>& all,
      const std::vector<std::int64_t>& first, VertexIndex v) {
    return absl::MakeConstSpan(all).subspan(first[v], first[v + 1] - first[v]);
  }

  std::vector<VertexIndex> faces_;
  std::vector<VertexIndex> neighbors_;
  std::vector<std::int64_t> first_face_;
  std::vector<std::int64_t> first_neighbor_;
};

}  // namespace isomatch
