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
/// Most steps of TurnTowardBest; a rotation that is nearly right needs two or
/// three.
constexpr int kMaxTurns = 6;
constexpr double kSmallTurn = 1e-3;

/// The rotation R that maximizes trace(R^T covariance).
Eigen::Matrix3d BestRotation(const Eigen::Matrix3d& covariance) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(
      covariance, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d left = svd.matrixU();
  if ((left * svd.matrixV().transpose()).determinant() < 0) left.col(2) *= -1;
  return left * svd.matrixV().transpose();
}

/// Turns a rotation toward the best one (Mueller, Bender, Chentanez, Macklin:
/// A Robust Method to Extract the Rotational Part of Deformations, 2016).
void TurnTowardBest(const Eigen::Matrix3d& covariance,
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
    // Nearly the angle, and small ones exactly.
    const Eigen::Quaterniond small(1, axis.x() / 2, axis.y() / 2, axis.z() / 2);
    *rotation = small.normalized().toRotationMatrix() * *rotation;
  }
}

}  // namespace

DeformableSurface::DeformableSurface(const TriangleMesh& mesh,
                                     const CotanLaplacian& laplacian)
    : rotations_(mesh.num_vertices(), Eigen::Matrix3d::Identity()) {
  const Eigen::Matrix3Xd rest = mesh.positions.transpose();
  std::vector<Eigen::Triplet<double>> entries;
  edges_.reserve(laplacian.stiffness.nonZeros());
  first_edges_.push_back(0);
  for (VertexIndex v = 0; v < mesh.num_vertices(); ++v) {
    using Entry = Eigen::SparseMatrix<double>::InnerIterator;
    for (Entry entry(laplacian.stiffness, v); entry; ++entry) {
      const auto other = static_cast<VertexIndex>(entry.row());
      if (other == v) continue;
      const double weight =
          std::clamp(-entry.value(), kLeastWeight, kLargestWeight);
      const Eigen::Vector3d edge = rest.col(v) - rest.col(other);
      edges_.push_back({other, weight, edge, weight * edge});
      entries.emplace_back(v, v, weight);
      entries.emplace_back(other, v, -weight);
    }
    first_edges_.push_back(edges_.size());
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
      absl::StrCat("Cholesky factorization of the elastic alignment failed, ",
                   pull.size(), " vertices, stiffness ", stiffness));
}

void DeformableSurface::FitRotation(VertexIndex v) {
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (const Edge& edge : EdgesOf(v)) {
    covariance +=
        (current_.col(v) - current_.col(edge.to)) * edge.weighted.transpose();
  }
  if (has_rotations_) {
    TurnTowardBest(covariance, &rotations_[v]);
  } else {
    rotations_[v] = BestRotation(covariance);
  }
}

/// All three axes at once, so that the factor is read once.
void DeformableSurface::Solve(Eigen::Matrix3Xd* right) const {
  const auto& permutation = cholesky_.permutationP().indices();
  const auto& factor = cholesky_.matrixL().nestedExpression();
  const Eigen::Index n = right->cols();
  Eigen::Matrix4Xd x(4, n);  // the fourth row is idle: four go at a time
  x.row(3).setZero();
  for (Eigen::Index i = 0; i < n; ++i) {
    x.col(permutation[i]).head<3>() = right->col(i);
  }
  const int* const starts = factor.outerIndexPtr();
  const int* const rows = factor.innerIndexPtr();
  const double* const values = factor.valuePtr();
  for (Eigen::Index j = 0; j < n; ++j) {
    const Eigen::Vector4d value = x.col(j) / values[starts[j]];
    x.col(j) = value;
    for (int at = starts[j] + 1; at < starts[j + 1]; ++at) {
      x.col(rows[at]) -= values[at] * value;
    }
  }
  for (Eigen::Index j = n - 1; j >= 0; --j) {
    Eigen::Vector4d value = x.col(j);
    for (int at = starts[j] + 1; at < starts[j + 1]; ++at) {
      value -= values[at] * x.col(rows[at]);
    }
    x.col(j) = value / values[starts[j]];
  }
  for (Eigen::Index i = 0; i < n; ++i) {
    right->col(i) = x.col(permutation[i]).head<3>();
  }
}

absl::Status DeformableSurface::Step(const Positions& targets,
                                     const std::stop_token& stop,
                                     Positions* positions) {
  const auto n = static_cast<VertexIndex>(rotations_.size());
  current_ = positions->transpose();
  ISOMATCH_RETURN_IF_ERROR(
      ParallelForVertices(n, stop, [&](VertexIndex v) { FitRotation(v); }));
  has_rotations_ = true;
  Eigen::Matrix3Xd right(3, n);
  ISOMATCH_RETURN_IF_ERROR(ParallelForVertices(n, stop, [&](VertexIndex v) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (const Edge& edge : EdgesOf(v)) {
      sum += (rotations_[v] + rotations_[edge.to]) * edge.weighted;
    }
    right.col(v) = pull_[v] * targets.row(v).transpose() + 0.5 * scale_ * sum;
  }));
  Solve(&right);
  *positions = right.transpose();
  return absl::OkStatus();
}

double DeformableSurface::Energy(const Positions& positions) const {
  double sum = 0;
  const auto n = static_cast<VertexIndex>(rotations_.size());
  for (VertexIndex v = 0; v < n; ++v) {
    for (const Edge& edge : EdgesOf(v)) {
      const Eigen::Vector3d bent = rotations_[v] * edge.rest;
      sum += edge.weight *
             (positions.row(v) - positions.row(edge.to) - bent.transpose())
                 .squaredNorm();
    }
  }
  return 0.5 * sum;
}

}  // namespace isomatch
