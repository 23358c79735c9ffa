#include "core/mesh/connected_ball.h"

namespace isomatch {

ConnectedBall::ConnectedBall(const TriangleMesh& mesh, const VertexStars& stars)
    : mesh_(mesh), stars_(stars), visited_(mesh.num_vertices(), 0) {}

const std::vector<ConnectedBall::Member>& ConnectedBall::Around(
    VertexIndex center, double radius) {
  ++visit_;
  members_.assign(1, {center, 0});
  visited_[center] = visit_;
  for (std::size_t i = 0; i < members_.size(); ++i) {
    for (const VertexIndex v : stars_.Neighbors(members_[i].vertex)) {
      if (visited_[v] == visit_) continue;
      visited_[v] = visit_;
      const double distance =
          (mesh_.positions.row(v) - mesh_.positions.row(center)).norm();
      if (distance < radius) members_.push_back({v, distance});
    }
  }
  return members_;
}

}  // namespace isomatch
