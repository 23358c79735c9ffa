#include "core/descriptor/shot_descriptor.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

#include "core/base/lanes.h"
#include "core/base/status_macros.h"
#include "core/mesh/connected_ball.h"

namespace isomatch {
namespace {

constexpr int kAzimuths = 8;
constexpr int kElevations = 2;
constexpr int kShells = 2;
static_assert(kAzimuths * kElevations * kShells * kShotCosines == kShotSize);

/// What is read of a vertex, in one place.
struct Surfel {
  std::array<float, 3> position;
  float area;
  std::array<float, 3> normal;
  float unused;
};

Lanes Dot(const LaneVector& a, const Eigen::Vector3f& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/// Members of a ball, seen from its center. Lanes without one have no area.
struct MemberLanes {
  LaneVector offset;
  LaneVector normal;
  Lanes distance;
  Lanes area;
};

std::vector<Surfel> SurfelsOf(const DescribedSurface& surface) {
  std::vector<Surfel> surfels(surface.mesh.num_vertices());
  for (std::size_t v = 0; v < surfels.size(); ++v) {
    const auto row = static_cast<Eigen::Index>(v);
    for (int i = 0; i < 3; ++i) {
      surfels[v].position[i] =
          static_cast<float>(surface.mesh.positions(row, i));
      surfels[v].normal[i] = static_cast<float>(surface.normals(row, i));
    }
    surfels[v].area = static_cast<float>(surface.areas[row]);
  }
  return surfels;
}

/// Those whose normal has at least this cosine with that of the center, which
/// is the first, and it itself.
std::vector<MemberLanes> Gather(const std::vector<Surfel>& surfels,
                                const std::vector<ConnectedBall::Member>& ball,
                                double least_cosine) {
  std::vector<MemberLanes> members((ball.size() + kLanes - 1) / kLanes,
                                   MemberLanes());
  const Surfel& center = surfels[ball.front().vertex];
  const auto least = static_cast<float>(least_cosine);
  int count = 0;
  for (const auto& [v, distance] : ball) {
    const Surfel& surfel = surfels[v];
    const float cosine = surfel.normal[0] * center.normal[0] +
                         surfel.normal[1] * center.normal[1] +
                         surfel.normal[2] * center.normal[2];
    if (count > 0 && cosine < least) continue;
    MemberLanes& member = members[count / kLanes];
    const int lane = count++ % kLanes;
    for (int i = 0; i < 3; ++i) {
      member.offset[i][lane] = surfel.position[i] - center.position[i];
      member.normal[i][lane] = surfel.normal[i];
    }
    member.distance[lane] = distance;
    member.area[lane] = surfel.area;
  }
  members.resize((count + kLanes - 1) / kLanes);
  return members;
}

/// Axes as columns.
using Frame = Eigen::Matrix3f;

/// The axes of the neighborhood, weighted toward its middle, each pointing to
/// where more of it lies; z along the normals.
Frame LocalFrame(const std::vector<MemberLanes>& members, float radius) {
  std::array<LaneVector, 3> sums = {};
  for (const MemberLanes& m : members) {
    const Lanes weight = m.area * (radius - m.distance);
    for (int i = 0; i < 3; ++i) {
      for (int j = i; j < 3; ++j) {
        sums[i][j] += weight * m.offset[i] * m.offset[j];
      }
    }
  }
  Eigen::Matrix3d covariance;
  for (int i = 0; i < 3; ++i) {
    for (int j = i; j < 3; ++j) {
      covariance(i, j) = covariance(j, i) = SumOfLanes(sums[i][j]);
    }
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(covariance);
  Eigen::Vector3f x = axes.eigenvectors().col(2).cast<float>();
  Eigen::Vector3f z = axes.eigenvectors().col(0).cast<float>();
  Lanes along_x = {};
  Lanes along_z = {};
  for (const MemberLanes& m : members) {
    const Lanes weight = m.area * (radius - m.distance);
    const Lanes along = Dot(m.offset, x);
    along_x += weight * along * AbsLanes(along);
    along_z += weight * Dot(m.normal, z);
  }
  if (SumOfLanes(along_x) < 0) x = -x;
  if (SumOfLanes(along_z) < 0) z = -z;
  Frame frame;
  frame << x, z.cross(x), z;
  return frame;
}

/// atan2(y, x) / (2 pi) + 1/2, right to 2e-6.
Lanes TurnOf(Lanes y, Lanes x) {
  constexpr auto kPi = std::numbers::pi_v<float>;
  const Lanes ax = AbsLanes(x);
  const Lanes ay = AbsLanes(y);
  const Lanes t =
      MinLanes(ax, ay) / MaxLanes(MaxLanes(ax, ay), AllLanes(1e-30f));
  const Lanes s = t * t;
  // Of atan in [0, 1]: minimax (Abramowitz and Stegun 4.4.49's form).
  constexpr std::array<float, 6> kTerms = {-0.01172120f, 0.05265332f,
                                           -0.11643287f, 0.19354346f,
                                           -0.33262347f, 0.99997726f};
  Lanes sum = {};
  for (const float term : kTerms) sum = sum * s + term;
  Lanes angle = t * sum;
  angle = ay > ax ? kPi / 2 - angle : angle;
  angle = x < 0 ? kPi - angle : angle;
  angle = y < 0 ? -angle : angle;
  return angle * (0.5f / kPi) + 0.5f;
}

/// Where members lie among the bins of each axis: k where it lies in the middle
/// of bin k.
struct BinPlaces {
  Lanes turn;
  Lanes height;
  Lanes shell;
  Lanes cosine;
};

BinPlaces PlacesOf(const MemberLanes& m, const Frame& frame, float radius) {
  const Lanes height =
      Dot(m.offset, frame.col(2)) / MaxLanes(m.distance, AllLanes(1e-20f));
  const Lanes cosine = MinLanes(
      MaxLanes(Dot(m.normal, frame.col(2)), AllLanes(-1)), AllLanes(1));
  return {TurnOf(Dot(m.offset, frame.col(1)), Dot(m.offset, frame.col(0))) *
                  kAzimuths -
              0.5f,
          (0.5f + 0.5f * height) * kElevations - 0.5f,
          m.distance / radius * kShells - 0.5f,
          (0.5f + 0.5f * cosine) * kShotCosines - 0.5f};
}

/// Two neighboring bins and what falls to each.
struct Bins {
  std::array<int, 2> at;
  std::array<float, 2> share;
};

/// Among `count` bins that end there. REQUIRES: place >= -1.
Bins Between(float place, int count) {
  const int bin = static_cast<int>(place + 1) - 1;
  const float share = place - static_cast<float>(bin);
  return {{std::clamp(bin, 0, count - 1), std::clamp(bin + 1, 0, count - 1)},
          {1 - share, share}};
}

/// The same where the last bin touches the first.
Bins Around(float place, int count) {
  const int bin = static_cast<int>(place + 1) - 1;
  const float share = place - static_cast<float>(bin);
  return {{(bin + count) % count, (bin + 1) % count}, {1 - share, share}};
}

void AddMember(const BinPlaces& places, int lane, float area,
               float* histogram) {
  const Bins turn = Around(places.turn[lane], kAzimuths);
  const Bins height = Between(places.height[lane], kElevations);
  const Bins shell = Between(places.shell[lane], kShells);
  const Bins cosine = Between(places.cosine[lane], kShotCosines);
  for (int corner = 0; corner < 8; ++corner) {
    const int t = corner >> 2;
    const int h = (corner >> 1) & 1;
    const int s = corner & 1;
    const float share = area * turn.share[t] * height.share[h] * shell.share[s];
    const int cell =
        (turn.at[t] * kElevations + height.at[h]) * kShells + shell.at[s];
    float* const bins = histogram + cell * kShotCosines;
    bins[cosine.at[0]] += share * cosine.share[0];
    bins[cosine.at[1]] += share * cosine.share[1];
  }
}

void Describe(const std::vector<MemberLanes>& members, float radius,
              Eigen::Ref<Eigen::VectorXf> histogram) {
  const Frame frame = LocalFrame(members, radius);
  histogram.setZero();
  for (const MemberLanes& m : members) {
    const BinPlaces places = PlacesOf(m, frame, radius);
    for (int lane = 0; lane < kLanes; ++lane) {
      if (m.area[lane] > 0) {
        AddMember(places, lane, m.area[lane], histogram.data());
      }
    }
  }
  histogram.stableNormalize();
}

}  // namespace

absl::StatusOr<PointColumns> ShotDescriptors(
    const DescribedSurface& surface, absl::Span<const VertexIndex> vertices,
    const ShotBall& ball, const std::stop_token& stop) {
  const auto count = static_cast<std::int64_t>(vertices.size());
  PointColumns columns(kShotSize, count);
  const std::vector<Surfel> surfels = SurfelsOf(surface);
  const auto radius = static_cast<float>(ball.radius);
  const auto describe = [&](std::int64_t i, ConnectedBall* around) {
    const auto& members = around->Around(vertices[i], ball.radius);
    Describe(Gather(surfels, members, ball.least_cosine), radius,
             columns.col(i));
  };
  ISOMATCH_RETURN_IF_ERROR(
      ParallelForWithBall(BallPositions(surface.mesh.positions), surface.stars,
                          count, stop, describe));
  return columns;
}

}  // namespace isomatch
