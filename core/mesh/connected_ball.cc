#include "core/mesh/connected_ball.h"

#include <algorithm>
#include <cmath>

#include "core/base/parallel.h"

namespace isomatch {
namespace {

constexpr std::int64_t kIndicesPerTask = 256;

/// Members of a ball at most, of a shape of more vertices a quarter of these:
/// where edges are as long as the shape, balls would hold all of it each.
constexpr std::size_t kMostMembers = 1000;
constexpr std::size_t kPartOfShape = 4;

}  // namespace

ConnectedBall::ConnectedBall(const Eigen::Matrix3Xd& positions,
                             const VertexStars& stars)
    : stars_(stars),
      positions_(positions),
      most_members_(
          std::max(kMostMembers,
                   static_cast<std::size_t>(positions.cols()) / kPartOfShape)),
      visited_(positions.cols(), 0) {}

const std::vector<ConnectedBall::Member>& ConnectedBall::Around(
    VertexIndex center, double radius) {
  ++visit_;
  members_.assign(1, {center, 0});
  visited_[center] = visit_;
  const Eigen::Vector3d middle = positions_.col(center);
  for (std::size_t i = 0; i < members_.size(); ++i) {
    for (const VertexIndex v : stars_.Neighbors(members_[i].vertex)) {
      if (visited_[v] == visit_) continue;
      visited_[v] = visit_;
      const double squared = (positions_.col(v) - middle).squaredNorm();
      if (squared < radius * radius) {
        members_.push_back({v, std::sqrt(squared)});
        if (members_.size() == most_members_) return members_;
      }
    }
  }
  return members_;
}

absl::Status ParallelForWithBall(
    const TriangleMesh& mesh, const VertexStars& stars, std::int64_t count,
    const std::stop_token& stop,
    const std::function<void(std::int64_t, ConnectedBall*)>& body) {
  // Side by side, since balls visit them one by one.
  const Eigen::Matrix3Xd positions = mesh.positions.transpose();
  const std::int64_t tasks = (count + kIndicesPerTask - 1) / kIndicesPerTask;
  return ParallelFor(tasks, stop, [&](std::int64_t task) {
    ConnectedBall ball(positions, stars);
    const std::int64_t end = std::min(count, (task + 1) * kIndicesPerTask);
    for (std::int64_t i = task * kIndicesPerTask; i < end; ++i) {
      if (stop.stop_requested()) return;
      body(i, &ball);
    }
  });
}

}  // namespace isomatch
