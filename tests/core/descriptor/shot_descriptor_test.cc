#include "core/descriptor/shot_descriptor.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>
#include <utility>
#include <vector>

#include <gtest/gtest.h>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

#include "core/mesh/connected_ball.h"
#include "core/mesh/mesh_geometry.h"
#include "core/spectral/cotan_laplacian.h"
#include "tests/support/dirty_meshes.h"
#include "tests/support/matchers.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

struct Described {
  Described(TriangleMesh surface, const ShotBall& ball)
      : mesh(std::move(surface)),
        normals(VertexNormals(mesh)),
        areas(BuildCotanLaplacian(mesh).mass),
        stars(mesh) {
    VertexMap all(mesh.num_vertices());
    std::iota(all.begin(), all.end(), 0);
    columns = *ShotDescriptors({mesh, normals, areas, stars}, all, ball, {});
  }

  TriangleMesh mesh;
  Positions normals;
  Eigen::VectorXd areas;
  VertexStars stars;
  PointColumns columns;
};

/// Of the first `count` descriptors of both.
double MeanDifference(const Described& a, const Described& b,
                      Eigen::Index count) {
  return (a.columns.leftCols(count) - b.columns.leftCols(count))
      .colwise()
      .squaredNorm()
      .mean();
}

/// What descriptors of different places differ by.
double UsualDifference(const Described& a) {
  const Eigen::Index n = a.columns.cols();
  double sum = 0;
  for (Eigen::Index v = 0; v < n; ++v) {
    sum += (a.columns.col(v) - a.columns.col((v + n / 2) % n)).squaredNorm();
  }
  return sum / static_cast<double>(n);
}

constexpr ShotBall kShotBall = {0.8};

/// Two bins next to `at` in [0, 1] among `count`, and what falls to each.
std::array<std::pair<int, double>, 2> Shares(double at, int count,
                                             bool around) {
  const double place = at * count - 0.5;
  const int bin = static_cast<int>(std::floor(place));
  const auto within = [&](int b) {
    return around ? (b + count) % count : std::clamp(b, 0, count - 1);
  };
  return {{{within(bin), 1 - (place - bin)}, {within(bin + 1), place - bin}}};
}

/// A descriptor one vertex after the other, in double precision.
Eigen::VectorXd PlainDescriptor(const Described& surface, VertexIndex center,
                                double radius) {
  const TriangleMesh& mesh = surface.mesh;
  std::vector<VertexIndex> near;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  const auto offset = [&](VertexIndex v) -> Eigen::Vector3d {
    return (mesh.positions.row(v) - mesh.positions.row(center)).transpose();
  };
  const auto weight = [&](VertexIndex v) {
    return surface.areas[v] * (radius - offset(v).norm());
  };
  const Eigen::Matrix4Xf positions = BallPositions(mesh.positions);
  ConnectedBall ball(positions, surface.stars);
  for (const auto& member : ball.Around(center, radius)) {
    near.push_back(member.vertex);
    covariance += weight(member.vertex) * offset(member.vertex) *
                  offset(member.vertex).transpose();
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(covariance);
  Eigen::Vector3d x = axes.eigenvectors().col(2);
  Eigen::Vector3d z = axes.eigenvectors().col(0);
  double along_x = 0;
  double along_z = 0;
  for (const VertexIndex v : near) {
    along_x += weight(v) * offset(v).dot(x) * std::abs(offset(v).dot(x));
    along_z += weight(v) * surface.normals.row(v).dot(z);
  }
  if (along_x < 0) x = -x;
  if (along_z < 0) z = -z;
  const Eigen::Vector3d y = z.cross(x);
  Eigen::VectorXd histogram = Eigen::VectorXd::Zero(kShotSize);
  for (const VertexIndex v : near) {
    const Eigen::Vector3d at = offset(v);
    const double far = at.norm();
    const double turn =
        std::atan2(at.dot(y), at.dot(x)) / (2 * std::numbers::pi) + 0.5;
    const double height = far > 0 ? 0.5 + 0.5 * at.dot(z) / far : 0.5;
    const double cosine = surface.normals.row(v).dot(z);
    for (const auto& [t, of_t] : Shares(turn, 8, true)) {
      for (const auto& [h, of_h] : Shares(height, 2, false)) {
        for (const auto& [s, of_s] : Shares(far / radius, 2, false)) {
          for (const auto& [c, of_c] :
               Shares(0.5 + 0.5 * cosine, kShotCosines, false)) {
            histogram[((t * 2 + h) * 2 + s) * kShotCosines + c] +=
                surface.areas[v] * of_t * of_h * of_s * of_c;
          }
        }
      }
    }
  }
  return histogram.normalized();
}

TEST(ShotDescriptorTest, IsWhatPlainArithmeticGives) {
  const Described arms(FiveArms(4), kShotBall);
  int same = 0;
  for (VertexIndex v = 0; v < arms.mesh.num_vertices(); ++v) {
    const Eigen::VectorXd plain = PlainDescriptor(arms, v, kShotBall.radius);
    same += (arms.columns.col(v).cast<double>() - plain).norm() < 1e-3;
  }
  // Where the surface is alike in all directions, rounding chooses the frame.
  EXPECT_GT(same, 0.9 * arms.mesh.num_vertices());
}

TEST(ShotDescriptorTest, HasLengthOne) {
  const Described arms(FiveArms(3), kShotBall);
  ASSERT_EQ(arms.columns.rows(), kShotSize);
  for (Eigen::Index v = 0; v < arms.columns.cols(); ++v) {
    EXPECT_NEAR(arms.columns.col(v).norm(), 1, 1e-5);
  }
  EXPECT_GE(arms.columns.minCoeff(), 0);
}

TEST(ShotDescriptorTest, MovingAndScalingTheShapeChangesNothing) {
  const Described arms(FiveArms(4), kShotBall);
  const Described moved(Moved(FiveArms(4), 7), {7 * kShotBall.radius});
  // Where the surface is alike in all directions, rounding chooses the frame.
  const Eigen::ArrayXf differences =
      (arms.columns - moved.columns).colwise().squaredNorm().transpose();
  EXPECT_GT((differences < 1e-5).count(), 0.9 * double(differences.size()));
}

TEST(ShotDescriptorTest, TheDensityOfTheMeshHardlyShows) {
  const DirtyMesh arms = Untouched(FiveArms(4));
  const DirtyMesh uneven = Refined(arms, Beyond({1, 0, 0}, 0));
  ASSERT_GT(uneven.mesh.num_vertices(), 1.3 * arms.mesh.num_vertices());
  const Described even_columns(arms.mesh, kShotBall);
  const Described uneven_columns(uneven.mesh, kShotBall);
  EXPECT_LT(
      MeanDifference(even_columns, uneven_columns, arms.mesh.num_vertices()),
      0.2 * UsualDifference(even_columns));
}

TEST(ShotDescriptorTest, AMirrorImageLooksDifferent) {
  const Described arms(FiveArms(3), kShotBall);
  TriangleMesh reflected = FiveArms(3);
  reflected.positions.col(0) *= -1;
  reflected.faces.col(1).swap(reflected.faces.col(2));
  const Described mirrored(reflected, kShotBall);
  EXPECT_GT(MeanDifference(arms, mirrored, arms.columns.cols()), 0.05);
}

/// The upper side of a thin slab looks as the slab does, of which only what
/// faces up counts.
TEST(ShotDescriptorTest, OneSideIsDescribedWithoutTheOther) {
  TriangleMesh slab = UnitSphere(4);
  slab.positions.col(2) *= 0.05;
  TriangleMesh upper = slab;
  VertexIndex faces = 0;
  for (VertexIndex f = 0; f < slab.num_faces(); ++f) {
    const auto corners = slab.positions(slab.faces.row(f), 2);
    if (corners.minCoeff() >= 0) upper.faces.row(faces++) = slab.faces.row(f);
  }
  upper.faces.conservativeResize(faces, Eigen::NoChange);
  const auto mean_difference = [&](const ShotBall& ball) {
    const Described of_slab(slab, ball);
    const Described of_upper(upper, ball);
    double sum = 0;
    int count = 0;
    for (VertexIndex v = 0; v < slab.num_vertices(); ++v) {
      if (slab.positions(v, 2) < 0.02) continue;
      sum += (of_slab.columns.col(v) - of_upper.columns.col(v)).squaredNorm();
      ++count;
    }
    return sum / count;
  };
  EXPECT_LT(mean_difference({.radius = 0.8, .least_cosine = 0.2}),
            0.25 * mean_difference({.radius = 0.8}));
}

TEST(ShotDescriptorTest, IsFiniteWhereTheBallHoldsOnlyItsCenter) {
  const Described lonely(FiveArms(1), {1e-3});
  EXPECT_TRUE(lonely.columns.allFinite());
}

TEST(ShotDescriptorTest, StopsWhenAsked) {
  const TriangleMesh mesh = FiveArms(2);
  const Positions normals = VertexNormals(mesh);
  const Eigen::VectorXd areas = BuildCotanLaplacian(mesh).mass;
  const VertexStars stars(mesh);
  std::stop_source source;
  source.request_stop();
  EXPECT_THAT(ShotDescriptors({mesh, normals, areas, stars}, {0, 1}, kShotBall,
                              source.get_token())
                  .status(),
              StatusIs(absl::StatusCode::kCancelled, testing::_));
}

}  // namespace
}  // namespace isomatch
