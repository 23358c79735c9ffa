#pragma once

#include <cstddef>
#include <vector>

#include "absl/types/span.h"
#include "core/mesh/topology.h"
#include "core/mesh/triangle_mesh.h"

namespace isomatch {

/// Follows the rims of a surface: edges of one face each, end to end. Where
/// rims touch in a vertex, each goes on around its own fan of faces.
///
/// Both arguments must outlive it. Time and memory O(m) for all rims together.
class RimWalker {
 public:
  RimWalker(const EdgeFaces& edges, const Faces& faces)
      : edges_(edges),
        faces_(faces),
        visited_(3 * static_cast<std::size_t>(faces.rows()), false) {}

  /// Where the side is of a rim that was not walked yet, walks it and returns
  /// its vertices in turn, valid until the next call; else nothing. At an edge
  /// of three faces or more a rim ends, and is not closed.
  absl::Span<const VertexIndex> Walk(EdgeFaces::Side side);

  /// Whether the last rim came back to where it began.
  bool is_closed() const { return is_closed_; }

 private:
  std::size_t Slot(EdgeFaces::Side side) const {
    return 3 * static_cast<std::size_t>(side.face) +
           static_cast<std::size_t>(side.corner);
  }

  /// Turns around `vertex` from face to face until a side has no other face.
  EdgeFaces::Side NextAround(EdgeFaces::Side side, VertexIndex vertex) const;

  const EdgeFaces& edges_;
  const Faces& faces_;
  std::vector<bool> visited_;
  std::vector<VertexIndex> vertices_;
  bool is_closed_ = false;
};

}  // namespace isomatch
