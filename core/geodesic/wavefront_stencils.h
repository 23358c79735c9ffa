#pragma once

#include <cstdint>
#include <vector>

#include "core/base/vertex_index.h"
#include "core/mesh/triangle_mesh.h"

namespace isomatch {

/// One way in which a wavefront reaches a vertex: over the edge between a
/// support vertex and another one, in the plane of their (unfolded) triangle.
/// The support lies at (0, 0), the other vertex at (base, 0), the target at
/// (target_x, target_y) with target_y >= 0.
struct WavefrontStencil {
  VertexIndex target;
  VertexIndex other;
  float base;
  float target_x;
  float target_y;
  float edge;  ///< from the support to the target
};

/// All stencils of a mesh by support vertex. Each face gives each of its
/// vertices a stencil over the opposite edge, from either end of it. Where the
/// angle at the vertex is obtuse, the triangles behind that edge are unfolded
/// into the plane until a vertex splits the angle into two acute ones, and the
/// two virtual triangles take the face's place (Kimmel, Sethian 1998, Section
/// 3.3), so that the front always comes from within the stencil.
///
/// Memory: 24 bytes a stencil, 12 to 15 stencils a vertex; twice that while
/// it is built.
class WavefrontStencils {
 public:
  explicit WavefrontStencils(const TriangleMesh& mesh);

  const WavefrontStencil* begin(VertexIndex support) const {
    return stencils_.data() + first_[support];
  }
  const WavefrontStencil* end(VertexIndex support) const {
    return stencils_.data() + first_[support + 1];
  }
  std::int64_t size() const {
    return static_cast<std::int64_t>(stencils_.size());
  }
  VertexIndex num_vertices() const {
    return static_cast<VertexIndex>(first_.size()) - 1;
  }

 private:
  std::vector<std::int64_t> first_;  ///< n + 1, start of each support's run
  std::vector<WavefrontStencil> stencils_;
};

}  // namespace isomatch
