#include "core/alignment/deformable_surface.h"

#include <algorithm>

#include <Eigen/Geometry>
#include <Eigen/SVD>

#include "absl/strings/str_cat.h"
#include "core/base/parallel.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

constexpr double kLeastWeight = 0.01;
constexpr double kLargestWeight = 10;
/// Of Turn; a rotation that is nearly right is right after two or three.
constexpr int kMaxTurns = 6;
constexpr double kSmallTurn = 1e-9;

/// The rotation R that maximises trace(R^T covariance).
Eigen::Matrix3d BestRotation(const Eigen::Matrix3d& covariance) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(
      covariance, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d left = svd.matrixU();
  if ((left * svd.matrixV().transpose()).determinant() < 0) left.col(2) *= -1;
  return left * svd.matrixV().transpose();
}

/// Turns a rotation towards the best one (Mueller, Bender, Chentanez, Macklin:
/// A Robust Method to Extract the Rotational Part of Deformations, 2016).
void TurnTowardsBest(const Eigen::Matrix3d& covariance,
                     Eigen::Matrix3d* rotation) {
  for (int turn = 0; turn < kMaxTurns; ++turn) {
    Eigen::Vector3d axis = Eigen::Vector3d::Zero();
    double alignment = 0;
    for (int i = 0; i < 3; ++i) {
      axis += rotation->col(i).cross(covariance.col(i));
      alignment += rotation->col(i).dot(covariance.col(i));
    }
    axis /= std::abs(alignment) + 1e-30;
    const double angle = axis.norm();
    if (!(angle > kSmallTurn)) return;
    *rotation =
        Eigen::AngleAxisd(angle, axis / angle).toRotationMatrix() * *rotation;
  }
}

}  // namespace

DeformableSurface::DeformableSurface(const TriangleMesh& mesh,
                                     const CotanLaplacian& laplacian)
    : rest_(mesh.positions),
      neighbors_(mesh.num_vertices()),
      rotations_(mesh.num_vertices(), Eigen::Matrix3d::Identity()) {
  std::vector<Eigen::Triplet<double>> entries;
  for (VertexIndex v = 0; v < mesh.num_vertices(); ++v) {
    using Entry = Eigen::SparseMatrix<double>::InnerIterator;
    for (Entry entry(laplacian.stiffness, v); entry; ++entry) {
      const auto other = static_cast<VertexIndex>(entry.row());
      if (other == v) continue;
      const double weight =
          std::clamp(-entry.value(), kLeastWeight, kLargestWeight);
      neighbors_[v].push_back({other, weight});
      entries.emplace_back(v, v, weight);
      entries.emplace_back(other, v, -weight);
    }
  }
  stiffness_.resize(mesh.num_vertices(), mesh.num_vertices());
  stiffness_.setFromTriplets(entries.begin(), entries.end());
}

absl::Status DeformableSurface::SetPull(const Eigen::VectorXd& pull,
                                        double stiffness) {
  pull_ = pull;
  scale_ = stiffness;
  Eigen::SparseMatrix<double> system = stiffness * stiffness_;
  system.diagonal() += pull;
  if (cholesky_.rows() == 0) cholesky_.analyzePattern(system);
  cholesky_.factorize(system);
  if (cholesky_.info() == Eigen::Success) return absl::OkStatus();
  return absl::InternalError(
      absl::StrCat("Cholesky factorisation of the elastic alignment failed, ",
                   rest_.rows(), " vertices, stiffness ", stiffness));
}

void DeformableSurface::FitRotation(const Positions& positions, VertexIndex v) {
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (const Neighbor& neighbor : neighbors_[v]) {
    covariance +=
        neighbor.weight *
        (positions.row(v) - positions.row(neighbor.vertex)).transpose() *
        (rest_.row(v) - rest_.row(neighbor.vertex));
  }
  if (has_rotations_) {
    TurnTowardsBest(covariance, &rotations_[v]);
  } else {
    rotations_[v] = BestRotation(covariance);
  }
}

absl::Status DeformableSurface::Step(const Positions& targets,
                                     const std::stop_token& stop,
                                     Positions* positions) {
  const auto n = static_cast<VertexIndex>(rest_.rows());
  ISOMATCH_RETURN_IF_ERROR(ParallelForVertices(
      n, stop, [&](VertexIndex v) { FitRotation(*positions, v); }));
  has_rotations_ = true;
  Eigen::MatrixXd right(n, 3);
  ISOMATCH_RETURN_IF_ERROR(ParallelForVertices(n, stop, [&](VertexIndex v) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (const Neighbor& neighbor : neighbors_[v]) {
      sum += 0.5 * neighbor.weight *
             ((rotations_[v] + rotations_[neighbor.vertex]) *
              (rest_.row(v) - rest_.row(neighbor.vertex)).transpose());
    }
    right.row(v) = pull_[v] * targets.row(v) + scale_ * sum.transpose();
  }));
  return ParallelFor(3, stop, [&](std::int64_t axis) {
    positions->col(axis) = cholesky_.solve(right.col(axis));
  });
}

double DeformableSurface::Energy(const Positions& positions) const {
  double sum = 0;
  for (std::size_t v = 0; v < neighbors_.size(); ++v) {
    for (const Neighbor& neighbor : neighbors_[v]) {
      const Eigen::Vector3d bent =
          rotations_[v] *
          (rest_.row(v) - rest_.row(neighbor.vertex)).transpose();
      sum +=
          neighbor.weight *
          (positions.row(v) - positions.row(neighbor.vertex) - bent.transpose())
              .squaredNorm();
    }
  }
  return 0.5 * sum;
}

}  // namespace isomatch
