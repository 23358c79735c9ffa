#include "core/descriptor/shot_descriptor.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <numbers>
#include <vector>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

#include "core/base/status_macros.h"
#include "core/mesh/connected_ball.h"

namespace isomatch {
namespace {

constexpr int kAzimuths = 8;
constexpr int kElevations = 2;
constexpr int kShells = 2;
constexpr int kCosines = 11;
static_assert(kAzimuths * kElevations * kShells * kCosines == kShotSize);

/// Axes as columns.
using Frame = Eigen::Matrix3d;

/// The axes of the neighborhood, weighted toward its middle, each pointing to
/// where more of it lies; z along the normals.
Frame LocalFrame(const DescribedSurface& surface,
                 const std::vector<ConnectedBall::Member>& ball,
                 double radius) {
  const Eigen::RowVector3d center =
      surface.mesh.positions.row(ball.front().vertex);
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (const auto& [v, distance] : ball) {
    const Eigen::Vector3d offset = surface.mesh.positions.row(v) - center;
    covariance +=
        surface.areas[v] * (radius - distance) * offset * offset.transpose();
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(covariance);
  Eigen::Vector3d x = axes.eigenvectors().col(2);
  Eigen::Vector3d z = axes.eigenvectors().col(0);
  double along_x = 0;
  double along_z = 0;
  for (const auto& [v, distance] : ball) {
    const Eigen::Vector3d offset = surface.mesh.positions.row(v) - center;
    const double weight = surface.areas[v] * (radius - distance);
    along_x += weight * offset.dot(x) * std::abs(offset.dot(x));
    along_z += weight * surface.normals.row(v).dot(z);
  }
  if (along_x < 0) x = -x;
  if (along_z < 0) z = -z;
  Frame frame;
  frame << x, z.cross(x), z;
  return frame;
}

/// Two neighboring bins and the share of the second.
struct Bins {
  int first;
  int second;
  double share;
};

/// `at` in [0, 1] over `count` bins that end there.
Bins Between(double at, int count) {
  const double place = at * count - 0.5;
  const double floor = std::floor(place);
  const int bin = static_cast<int>(floor);
  return {std::clamp(bin, 0, count - 1), std::clamp(bin + 1, 0, count - 1),
          place - floor};
}

/// The same where the last bin touches the first.
Bins Around(double at, int count) {
  const double place = at * count - 0.5;
  const double floor = std::floor(place);
  const int bin = static_cast<int>(floor) + count;
  return {bin % count, (bin + 1) % count, place - floor};
}

/// A vertex of a ball, as its center sees it.
struct SeenPoint {
  /// In the center's frame.
  Eigen::Vector3d local;
  double distance;
  /// Between its normal and the center's.
  double cosine;
  double area;
};

void AddPoint(const SeenPoint& point, double radius, float* histogram) {
  const auto& [local, distance, cosine, area] = point;
  const double turn =
      std::atan2(local.y(), local.x()) / (2 * std::numbers::pi) + 0.5;
  const double height = distance > 0 ? 0.5 + 0.5 * local.z() / distance : 0.5;
  const std::array<Bins, 4> bins = {
      Around(turn, kAzimuths), Between(height, kElevations),
      Between(distance / radius, kShells),
      Between(0.5 + 0.5 * std::clamp(cosine, -1.0, 1.0), kCosines)};
  constexpr std::array<int, 4> kCounts = {kAzimuths, kElevations, kShells,
                                          kCosines};
  for (int corner = 0; corner < 16; ++corner) {
    double share = area;
    int bin = 0;
    for (int axis = 0; axis < 4; ++axis) {
      const bool second = (corner >> axis) & 1;
      share *= second ? bins[axis].share : 1 - bins[axis].share;
      bin =
          bin * kCounts[axis] + (second ? bins[axis].second : bins[axis].first);
    }
    histogram[bin] += static_cast<float>(share);
  }
}

/// Those that face as the center does, which is the first.
std::vector<ConnectedBall::Member> Facing(
    const DescribedSurface& surface,
    const std::vector<ConnectedBall::Member>& ball, double least_cosine) {
  const auto& normal = surface.normals.row(ball.front().vertex);
  std::vector<ConnectedBall::Member> facing = {ball.front()};
  std::copy_if(ball.begin() + 1, ball.end(), std::back_inserter(facing),
               [&](const ConnectedBall::Member& member) {
                 return surface.normals.row(member.vertex).dot(normal) >=
                        least_cosine;
               });
  return facing;
}

void Describe(const DescribedSurface& surface,
              const std::vector<ConnectedBall::Member>& ball, double radius,
              Eigen::Ref<Eigen::VectorXf> histogram) {
  const Frame frame = LocalFrame(surface, ball, radius);
  const Eigen::RowVector3d center =
      surface.mesh.positions.row(ball.front().vertex);
  histogram.setZero();
  for (const auto& [v, distance] : ball) {
    const Eigen::Vector3d local =
        ((surface.mesh.positions.row(v) - center) * frame).transpose();
    AddPoint({local, distance, surface.normals.row(v).dot(frame.col(2)),
              surface.areas[v]},
             radius, histogram.data());
  }
  histogram.stableNormalize();
}

}  // namespace

absl::StatusOr<PointColumns> ShotDescriptors(
    const DescribedSurface& surface, absl::Span<const VertexIndex> vertices,
    const ShotBall& ball, const std::stop_token& stop) {
  const auto count = static_cast<std::int64_t>(vertices.size());
  PointColumns columns(kShotSize, count);
  ISOMATCH_RETURN_IF_ERROR(ParallelForWithBall(
      surface.mesh, surface.stars, count, stop,
      [&](std::int64_t i, ConnectedBall* around) {
        const auto& all = around->Around(vertices[i], ball.radius);
        if (ball.least_cosine < -1) {
          Describe(surface, all, ball.radius, columns.col(i));
        } else {
          Describe(surface, Facing(surface, all, ball.least_cosine),
                   ball.radius, columns.col(i));
        }
      }));
  return columns;
}

}  // namespace isomatch
