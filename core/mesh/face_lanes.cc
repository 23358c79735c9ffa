#include "core/mesh/face_lanes.h"

#include <algorithm>
#include <limits>

#include <Eigen/Core>

namespace isomatch {
namespace {

/// Squared, it is still a number, and larger than any squared distance.
constexpr float kFarAway = 1e18f;

Lanes ToUnit(Lanes lanes) {
  return MinLanes(MaxLanes(lanes, AllLanes(0)), AllLanes(1));
}

/// The nearest point found yet, s u + t v.
struct NearestLanes {
  Lanes least = AllLanes(std::numeric_limits<float>::infinity());
  Lanes s = {};
  Lanes t = {};

  void Offer(Lanes squared, Lanes at_s, Lanes at_t) {
    const LaneBits nearer = squared < least;
    least = nearer ? squared : least;
    s = nearer ? at_s : s;
    t = nearer ? at_t : t;
  }
};

}  // namespace

FaceLanes::FaceLanes(const TriangleMesh& mesh,
                     absl::Span<const VertexIndex> faces, VertexIndex vertex)
    : origin_(mesh.positions.row(vertex)),
      groups_((faces.size() + kLanes - 1) / kLanes) {
  for (std::size_t i = 0; i < faces.size(); ++i) {
    SetLane(mesh, faces[i], static_cast<int>(i % kLanes), &groups_[i / kLanes]);
  }
  for (std::size_t i = faces.size(); i < groups_.size() * kLanes; ++i) {
    groups_.back().corner[0][i % kLanes] = kFarAway;
  }
}

void FaceLanes::SetLane(const TriangleMesh& mesh, VertexIndex face, int lane,
                        Group* group) const {
  // From far away a distance would be the rounding of large products.
  Eigen::Index corner = 0;
  (mesh.positions(mesh.faces.row(face), Eigen::all).rowwise() - origin_)
      .rowwise()
      .squaredNorm()
      .minCoeff(&corner);
  const Eigen::RowVector3d from = mesh.positions.row(mesh.faces(face, corner));
  const auto side_to = [&](int steps) -> Eigen::RowVector3d {
    return mesh.positions.row(mesh.faces(face, (corner + steps) % 3)) - from;
  };
  // In double: what sets slivers apart from lines is lost in single products.
  const Eigen::RowVector3d u = side_to(1);
  const Eigen::RowVector3d v = side_to(2);
  const double uu = u.squaredNorm();
  const double uv = u.dot(v);
  const double vv = v.squaredNorm();
  const double determinant = uu * vv - uv * uv;
  constexpr double kLeastDeterminant = 1e-12;
  const double by_area =
      determinant > kLeastDeterminant * uu * vv ? 1 / determinant : 0;
  const Eigen::RowVector3d to_s = (vv * u - uv * v) * by_area;
  const Eigen::RowVector3d to_t = (uu * v - uv * u) * by_area;
  const std::array<double, 3> squared = {uu, vv, (v - u).squaredNorm()};
  for (int i = 0; i < 3; ++i) {
    group->corner[i][lane] = static_cast<float>(from[i] - origin_[i]);
    group->u[i][lane] = static_cast<float>(u[i]);
    group->v[i][lane] = static_cast<float>(v[i]);
    group->to_s[i][lane] = static_cast<float>(to_s[i]);
    group->to_t[i][lane] = static_cast<float>(to_t[i]);
    group->inverse[i][lane] =
        squared[i] > 0 ? static_cast<float>(1 / squared[i]) : 0;
  }
  group->faces[lane] = face;
  group->corners[lane] = static_cast<int>(corner);
}

SurfacePoint FaceLanes::Nearest(const Eigen::RowVector3d& position) const {
  const Eigen::RowVector3f offset = (position - origin_).cast<float>();
  const Lanes none = {};
  // What it stays where no distance is a number.
  SurfacePoint nearest = {groups_.front().faces[0]};
  nearest.weights[groups_.front().corners[0]] = 1;
  float least = std::numeric_limits<float>::infinity();
  for (const Group& group : groups_) {
    const LaneVector w = {offset[0] - group.corner[0],
                          offset[1] - group.corner[1],
                          offset[2] - group.corner[2]};
    const Lanes uu = DotLanes(group.u, group.u);
    const Lanes uv = DotLanes(group.u, group.v);
    const Lanes vv = DotLanes(group.v, group.v);
    const Lanes uw = DotLanes(group.u, w);
    const Lanes vw = DotLanes(group.v, w);
    const Lanes ww = DotLanes(w, w);
    const auto squared = [&](Lanes s, Lanes t) {
      return ww + s * (s * uu - 2 * uw) + t * (t * vv - 2 * vw) +
             2 * s * t * uv;
    };
    NearestLanes found;
    const auto offer = [&](Lanes s, Lanes t) {
      found.Offer(squared(s, t), s, t);
    };
    const Lanes s = DotLanes(group.to_s, w);
    const Lanes t = DotLanes(group.to_t, w);
    const LaneBits inside = (s >= 0) & (t >= 0) & (s + t <= 1);
    offer(inside ? s : none, inside ? t : none);
    offer(ToUnit(uw * group.inverse[0]), none);
    offer(none, ToUnit(vw * group.inverse[1]));
    const Lanes across = ToUnit((vw - uv - uw + uu) * group.inverse[2]);
    offer(1 - across, across);
    for (int lane = 0; lane < kLanes; ++lane) {
      if (!(found.least[lane] < least)) continue;
      least = found.least[lane];
      const double at_s = found.s[lane];
      const double at_t = found.t[lane];
      const int corner = group.corners[lane];
      nearest.face = group.faces[lane];
      nearest.weights[corner] = std::max(0.0, 1 - at_s - at_t);
      nearest.weights[(corner + 1) % 3] = at_s;
      nearest.weights[(corner + 2) % 3] = at_t;
    }
  }
  return nearest;
}

std::vector<FaceLanes> FacesAroundVertices(const TriangleMesh& mesh,
                                           const VertexStars& stars) {
  std::vector<FaceLanes> around;
  around.reserve(mesh.num_vertices());
  for (VertexIndex v = 0; v < mesh.num_vertices(); ++v) {
    around.emplace_back(mesh, stars.SomeFaces(v), v);
  }
  return around;
}

}  // namespace isomatch
