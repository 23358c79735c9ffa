#include "core/mesh/connected_ball.h"

#include <algorithm>
#include <cmath>

#include "core/base/parallel.h"

namespace isomatch {
namespace {

/// Tasks at most, or so: each makes a ball as large as the mesh.
constexpr std::int64_t kTasks = 64;

/// Members of a ball at most, of a shape of more vertices a quarter of these:
/// where edges are as long as the shape, balls would hold all of it each.
constexpr std::size_t kMostMembers = 1000;
constexpr std::size_t kPartOfShape = 4;

}  // namespace

ConnectedBall::ConnectedBall(const Eigen::Matrix4Xf& positions,
                             const VertexStars& stars)
    : stars_(stars),
      positions_(positions),
      most_members_(
          std::max(kMostMembers,
                   static_cast<std::size_t>(positions.cols()) / kPartOfShape)),
      fresh_(positions.cols() + 1),
      visited_(positions.cols(), 0) {}

const std::vector<ConnectedBall::Member>& ConnectedBall::Around(
    VertexIndex center, double radius) {
  if (!members_.empty() && members_.front().vertex == center &&
      radius == radius_) {
    return members_;
  }
  radius_ = radius;
  ++visit_;
  members_.assign(1, {center, 0});
  visited_[center] = visit_;
  const Eigen::Vector4f middle = positions_.col(center);
  const auto enough = static_cast<float>(radius * radius);
  // Level by level of edges, and without branches that no one can foretell.
  for (std::size_t begin = 0; begin < members_.size();) {
    std::size_t fresh = 0;
    std::size_t end = members_.size();
    for (; begin < end; ++begin) {
      for (const VertexIndex v : stars_.Neighbors(members_[begin].vertex)) {
        fresh_[fresh] = v;
        fresh += visited_[v] != visit_;
        visited_[v] = visit_;
      }
    }
    members_.resize(end + fresh);
    for (std::size_t i = 0; i < fresh; ++i) {
      const float squared = (positions_.col(fresh_[i]) - middle).squaredNorm();
      members_[end] = {fresh_[i], std::sqrt(squared)};
      end += squared < enough;
    }
    members_.resize(std::min(end, most_members_));
    if (members_.size() == most_members_) break;
  }
  return members_;
}

Eigen::Matrix4Xf BallPositions(const Positions& positions) {
  Eigen::Matrix4Xf columns(4, positions.rows());
  columns.topRows<3>() = positions.transpose().cast<float>();
  columns.row(3).setZero();
  return columns;
}

absl::Status ParallelForWithBall(
    const Eigen::Matrix4Xf& positions, const VertexStars& stars,
    std::int64_t count, const std::stop_token& stop,
    const std::function<void(std::int64_t, ConnectedBall*)>& body) {
  const std::int64_t per_task = (count + kTasks - 1) / kTasks;
  const std::int64_t tasks = count > 0 ? (count + per_task - 1) / per_task : 0;
  return ParallelFor(tasks, stop, [&](std::int64_t task) {
    ConnectedBall ball(positions, stars);
    const std::int64_t end = std::min(count, (task + 1) * per_task);
    for (std::int64_t i = task * per_task; i < end; ++i) {
      if (stop.stop_requested()) return;
      body(i, &ball);
    }
  });
}

}  // namespace isomatch
