#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <stop_token>
#include <vector>

#include "absl/status/status.h"
#include "core/base/vertex_index.h"
#include "core/mesh/triangle_mesh.h"
#include "core/mesh/vertex_stars.h"

namespace isomatch {

/// The part of a surface around a vertex: what edges reach from it without
/// leaving a ball in space, so that a limb that only touches stays out.
///
/// Memory O(n), used again and again. Not thread-safe. References must outlive
/// it.
class ConnectedBall {
 public:
  struct Member {
    VertexIndex vertex;
    float distance;  ///< from the center, straight, mesh units
  };

  /// `positions`: BallPositions of the mesh.
  ConnectedBall(const Eigen::Matrix4Xf& positions, const VertexStars& stars);

  /// The vertices nearer than `radius`, the center first, in an order that
  /// depends on the mesh alone. Of more than 1,000, or a quarter of the shape
  /// where that is more, only so many, to which the fewest edges lead. Valid
  /// until the next call. Time O(members and their neighbors); none for what
  /// was asked last.
  const std::vector<Member>& Around(VertexIndex center, double radius);

 private:
  const VertexStars& stars_;
  const Eigen::Matrix4Xf& positions_;
  const std::size_t most_members_;
  double radius_ = 0;  ///< of members_
  std::vector<Member> members_;
  std::vector<VertexIndex> fresh_;  ///< what a level has seen first
  std::uint32_t visit_ = 0;
  std::vector<std::uint32_t> visited_;  ///< the last visit of each vertex
};

/// One vertex a column, and a 0 below: a register each.
Eigen::Matrix4Xf BallPositions(const Positions& positions);

/// Calls `body(i, ball)` for i in [0, count) as ParallelFor does, each task
/// with a ball of its own. Balls can be large: a stop is seen between any two.
/// `positions`: BallPositions of the mesh.
absl::Status ParallelForWithBall(
    const Eigen::Matrix4Xf& positions, const VertexStars& stars,
    std::int64_t count, const std::stop_token& stop,
    const std::function<void(std::int64_t, ConnectedBall*)>& body);

}  // namespace isomatch
