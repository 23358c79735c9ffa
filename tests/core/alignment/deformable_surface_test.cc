#include "core/alignment/deformable_surface.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <gtest/gtest.h>
#include <Eigen/Geometry>
#include <Eigen/SVD>

#include "tests/support/matchers.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

Eigen::Matrix3d SomeRotation() {
  return Eigen::AngleAxisd(2.2, Eigen::Vector3d(1, -2, 0.5).normalized())
      .toRotationMatrix();
}

class DeformableSurfaceTest : public testing::Test {
 protected:
  DeformableSurfaceTest()
      : mesh_(FiveArms(3)),
        laplacian_(BuildCotanLaplacian(mesh_)),
        surface_(mesh_, laplacian_) {}

  Positions After(const Positions& targets, int steps) {
    Positions positions = targets;
    for (int step = 0; step < steps; ++step) {
      EXPECT_THAT(surface_.Step(targets, {}, &positions), IsOk());
    }
    return positions;
  }

  const TriangleMesh mesh_;
  const CotanLaplacian laplacian_;
  DeformableSurface surface_;
};

TEST_F(DeformableSurfaceTest, RigidMotionsCostNothing) {
  const Positions moved =
      (mesh_.positions * SomeRotation().transpose()).rowwise() +
      Eigen::RowVector3d(3, -1, 2);
  ASSERT_THAT(surface_.SetPull(laplacian_.mass, 1), IsOk());
  const Positions positions = After(moved, 2);
  // But for rotations in single precision.
  EXPECT_LT((positions - moved).cwiseAbs().maxCoeff(), 1e-6);
  EXPECT_NEAR(surface_.Energy(positions), 0, 1e-11);
}

TEST_F(DeformableSurfaceTest, AHalfTurnIsFound) {
  // From no rotation nothing says which way round.
  const Positions turned =
      mesh_.positions * Eigen::Vector3d(-1, -1, 1).asDiagonal();
  ASSERT_THAT(surface_.SetPull(laplacian_.mass, 1), IsOk());
  const Positions positions = After(turned, 1);
  EXPECT_LT((positions - turned).cwiseAbs().maxCoeff(), 1e-5);
  EXPECT_NEAR(surface_.Energy(positions), 0, 1e-9);
}

TEST_F(DeformableSurfaceTest, NoRotationsFitBetterThanThoseOfSingularValues) {
  Positions bent = mesh_.positions * SomeRotation().transpose();
  for (Eigen::Index v = 0; v < bent.rows(); ++v) {
    bent(v, 1) += 0.8 * std::sin(4 * bent(v, 0));
    bent(v, 2) *= 1.5;
  }
  ASSERT_THAT(surface_.SetPull(laplacian_.mass, 1), IsOk());
  Positions moved = bent;
  ASSERT_THAT(surface_.Step(bent, {}, &moved), IsOk());
  double least = 0;
  for (VertexIndex v = 0; v < mesh_.num_vertices(); ++v) {
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
    double free = 0;
    using Entry = Eigen::SparseMatrix<double>::InnerIterator;
    for (Entry entry(laplacian_.stiffness, v); entry; ++entry) {
      if (entry.row() == v) continue;
      const double weight = std::clamp(-entry.value(), 0.01, 10.0);
      const Eigen::RowVector3d now = bent.row(v) - bent.row(entry.row());
      const Eigen::RowVector3d rest =
          mesh_.positions.row(v) - mesh_.positions.row(entry.row());
      covariance += weight * now.transpose() * rest;
      free += weight * (now.squaredNorm() + rest.squaredNorm());
    }
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(
        covariance, Eigen::ComputeFullU | Eigen::ComputeFullV);
    const double sign =
        (svd.matrixU() * svd.matrixV().transpose()).determinant();
    const Eigen::Vector3d singular = svd.singularValues();
    least += 0.5 * (free - 2 * (singular[0] + singular[1] +
                                (sign < 0 ? -1 : 1) * singular[2]));
  }
  EXPECT_NEAR(surface_.Energy(bent), least, 1e-3 * least);
}

TEST_F(DeformableSurfaceTest, StretchingCosts) {
  const Positions stretched = 1.5 * mesh_.positions;
  ASSERT_THAT(surface_.SetPull(laplacian_.mass, 1e-6), IsOk());
  Positions positions = After(stretched, 1);
  const double soft = surface_.Energy(positions);
  EXPECT_GT(soft, 0.1);
  EXPECT_LT((positions - stretched).cwiseAbs().maxCoeff(), 1e-3);
  // A stiff one goes back to its size.
  ASSERT_THAT(surface_.SetPull(laplacian_.mass, 1e4), IsOk());
  positions = After(stretched, 30);
  EXPECT_LT(surface_.Energy(positions), 1e-3 * soft);
}

TEST_F(DeformableSurfaceTest, StepsNeverRaiseTheObjective) {
  Positions targets = mesh_.positions;
  for (Eigen::Index v = 0; v < targets.rows(); ++v) {
    targets(v, 1) += 0.3 * std::sin(3 * targets(v, 0));
  }
  constexpr double kStiffness = 0.2;
  ASSERT_THAT(surface_.SetPull(laplacian_.mass, kStiffness), IsOk());
  Positions positions = targets;
  double before = std::numeric_limits<double>::infinity();
  for (int step = 0; step < 8; ++step) {
    ASSERT_THAT(surface_.Step(targets, {}, &positions), IsOk());
    const double pulled =
        (positions - targets).rowwise().squaredNorm().dot(laplacian_.mass);
    const double objective = pulled + kStiffness * surface_.Energy(positions);
    EXPECT_LE(objective, before * (1 + 1e-9)) << step;
    before = objective;
  }
}

TEST_F(DeformableSurfaceTest, StopsWhenAsked) {
  ASSERT_THAT(surface_.SetPull(laplacian_.mass, 1), IsOk());
  std::stop_source stop;
  stop.request_stop();
  Positions positions = mesh_.positions;
  EXPECT_THAT(surface_.Step(mesh_.positions, stop.get_token(), &positions),
              StatusIs(absl::StatusCode::kCancelled, testing::_));
}

}  // namespace
}  // namespace isomatch
