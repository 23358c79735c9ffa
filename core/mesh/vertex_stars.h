#pragma once

#include <cstddef>
#include <cstdint>
#include <unordered_map>
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
  /// REQUIRES: no more faces than ValidateMesh lets pass.
  explicit VertexStars(const TriangleMesh& mesh);

  /// By increasing face.
  absl::Span<const VertexIndex> Faces(VertexIndex v) const {
    return Slice(faces_, first_face_, v);
  }
  /// By increasing vertex, each once.
  absl::Span<const VertexIndex> Neighbors(VertexIndex v) const {
    return Slice(neighbors_, first_neighbor_, v);
  }

  /// Faces or neighbors that SomeFaces and SomeNeighbors return at most.
  static constexpr std::size_t kSome = 256;

  /// All faces or neighbors of a vertex; of more than kSome, so many at even
  /// steps. What is done for every vertex around every vertex uses these, so
  /// that a fan of n faces does not take n^2 steps.
  absl::Span<const VertexIndex> SomeFaces(VertexIndex v) const {
    const auto all = Faces(v);
    return all.size() <= kSome ? all : some_of_hubs_.at(v).faces;
  }
  absl::Span<const VertexIndex> SomeNeighbors(VertexIndex v) const {
    const auto all = Neighbors(v);
    return all.size() <= kSome ? all : some_of_hubs_.at(v).neighbors;
  }

 private:
  /// Some faces and neighbors of a vertex that has more than kSome of either.
  struct Hub {
    std::vector<VertexIndex> faces;
    std::vector<VertexIndex> neighbors;
  };

  static absl::Span<const VertexIndex> Slice(
      const std::vector<VertexIndex>& all,
      const std::vector<std::int32_t>& first, VertexIndex v) {
    return absl::MakeConstSpan(all).subspan(first[v], first[v + 1] - first[v]);
  }

  std::vector<VertexIndex> faces_;
  std::vector<VertexIndex> neighbors_;
  std::vector<std::int32_t> first_face_;
  std::vector<std::int32_t> first_neighbor_;
  std::unordered_map<VertexIndex, Hub> some_of_hubs_;
};

}  // namespace isomatch
