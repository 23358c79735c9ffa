#include "core/mesh/rim_walker.h"

namespace isomatch {
namespace {

using Side = EdgeFaces::Side;

/// The other side of the side's face that ends at `vertex`.
Side OtherSideAt(const Faces& faces, Side side, VertexIndex vertex) {
  for (int step = 1; step < 3; ++step) {
    const int corner = (side.corner + step) % 3;
    if (faces(side.face, corner) == vertex ||
        faces(side.face, (corner + 1) % 3) == vertex) {
      return {side.face, corner};
    }
  }
  return side;
}

}  // namespace

absl::Span<const VertexIndex> RimWalker::Walk(Side side) {
  vertices_.clear();
  const std::size_t first = Slot(side);
  VertexIndex tip = faces_(side.face, side.corner);
  while (edges_.IsBoundary(side.face, side.corner) && !visited_[Slot(side)]) {
    visited_[Slot(side)] = true;
    vertices_.push_back(tip);
    const VertexIndex from = faces_(side.face, side.corner);
    tip = from == tip ? faces_(side.face, (side.corner + 1) % 3) : from;
    side = NextAround(side, tip);
  }
  is_closed_ = Slot(side) == first;
  return vertices_;
}

Side RimWalker::NextAround(Side side, VertexIndex vertex) const {
  while (true) {
    side = OtherSideAt(faces_, side, vertex);
    const Side across = edges_.Opposite(side.face, side.corner);
    if (across.face == kNoVertex) return side;
    side = across;
  }
}

}  // namespace isomatch
