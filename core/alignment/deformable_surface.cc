#include "core/alignment/deformable_surface.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <iterator>

#include <Eigen/LU>
#include <Eigen/SVD>

#include "absl/strings/str_cat.h"
#include "core/base/lanes.h"
#include "core/base/parallel.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

constexpr double kLeastWeight = 0.01;
constexpr double kLargestWeight = 10;
/// Most steps of TurnTowardBest: of rotations that are nearly right, which need
/// two or three, and at first.
constexpr int kTurns = 6;
constexpr int kFirstTurns = 24;
constexpr float kSmallTurn = 1e-3f;
constexpr VertexIndex kVerticesPerTask = 256;

/// A 3 x 3 matrix of each lane, column by column.
using LaneMatrix = std::array<LaneVector, 3>;

/// Turns by the unit quaternion along (1, axis / 2): nearly by the length of
/// `axis`, and small angles exactly.
void Turn(const LaneVector& axis, Lanes squared_length, LaneMatrix* rotation) {
  const Lanes w = 1 / SqrtLanes(1 + 0.25f * squared_length);
  const Lanes x = 0.5f * axis[0] * w;
  const Lanes y = 0.5f * axis[1] * w;
  const Lanes z = 0.5f * axis[2] * w;
  const Lanes rows[3][3] = {
      {1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)},
      {2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)},
      {2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)}};
  for (LaneVector& column : *rotation) {
    const LaneVector old = column;
    for (int i = 0; i < 3; ++i) {
      column[i] =
          rows[i][0] * old[0] + rows[i][1] * old[1] + rows[i][2] * old[2];
    }
  }
}

/// Turns rotations toward the best ones (Mueller, Bender, Chentanez, Macklin:
/// A Robust Method to Extract the Rotational Part of Deformations, 2016).
void TurnTowardBest(const LaneMatrix& covariance, int turns,
                    LaneMatrix* rotation) {
  for (int turn = 0; turn < turns; ++turn) {
    LaneVector axis = {};
    Lanes alignment = {};
    for (int i = 0; i < 3; ++i) {
      const LaneVector& r = (*rotation)[i];
      const LaneVector& c = covariance[i];
      axis[0] += r[1] * c[2] - r[2] * c[1];
      axis[1] += r[2] * c[0] - r[0] * c[2];
      axis[2] += r[0] * c[1] - r[1] * c[0];
      alignment += r[0] * c[0] + r[1] * c[1] + r[2] * c[2];
    }
    const Lanes inverse = 1 / (AbsLanes(alignment) + 1e-30f);
    Lanes squared_length = {};
    for (Lanes& a : axis) {
      a *= inverse;
      squared_length += a * a;
    }
    if (!AnyLane(squared_length > AllLanes(kSmallTurn * kSmallTurn))) return;
    Turn(axis, squared_length, rotation);
  }
}

}  // namespace

Eigen::Matrix3d BestRotation(const Eigen::Matrix3d& covariance) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(
      covariance, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d left = svd.matrixU();
  if ((left * svd.matrixV().transpose()).determinant() < 0) left.col(2) *= -1;
  return left * svd.matrixV().transpose();
}

DeformableSurface::DeformableSurface(const TriangleMesh& mesh,
                                     const CotanLaplacian& laplacian)
    : rotations_(mesh.num_vertices(), Rotation::Identity()) {
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
      edges_.push_back({(weight * edge).cast<float>(), other,
                        edge.cast<float>(), static_cast<float>(weight)});
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

DeformableSurface::Rotation DeformableSurface::Covariance(VertexIndex v) const {
  Rotation sum = Rotation::Zero();
  const Eigen::Vector4f own = current_.col(v);
  for (const Edge& edge : EdgesOf(v)) {
    const Eigen::Vector4f now = own - current_.col(edge.to);
    for (int i = 0; i < 3; ++i) sum.col(i) += edge.weighted[i] * now;
  }
  return sum;
}

void DeformableSurface::FitRotations(VertexIndex begin, VertexIndex end,
                                     int turns) {
  LaneMatrix covariance = {};
  LaneMatrix rotation = {};
  for (VertexIndex v = begin; v < end; ++v) {
    const Rotation sum = Covariance(v);
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) {
        covariance[i][j][v - begin] = sum(j, i);
        rotation[i][j][v - begin] = rotations_[v](j, i);
      }
    }
  }
  TurnTowardBest(covariance, turns, &rotation);
  for (VertexIndex v = begin; v < end; ++v) {
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) {
        rotations_[v](j, i) = rotation[i][j][v - begin];
      }
    }
  }
}

/// From there most turns are small; from no rotation one by 180 degrees would
/// not know which way round.
void DeformableSurface::StartRotations() {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (VertexIndex v = 0; v < std::ssize(rotations_); ++v) {
    sum += Covariance(v).topRows<3>().cast<double>();
  }
  Rotation start = Rotation::Zero();
  start.topRows<3>() = BestRotation(sum).cast<float>();
  std::fill(rotations_.begin(), rotations_.end(), start);
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

Eigen::Vector3d DeformableSurface::RotatedEdges(VertexIndex v) const {
  Eigen::Vector4f sum = Eigen::Vector4f::Zero();
  const Rotation& own = rotations_[v];
  for (const Edge& edge : EdgesOf(v)) {
    const Rotation& other = rotations_[edge.to];
    for (int i = 0; i < 3; ++i) {
      sum += edge.weighted[i] * (own.col(i) + other.col(i));
    }
  }
  return sum.head<3>().cast<double>();
}

absl::Status DeformableSurface::Step(const Positions& targets,
                                     const std::stop_token& stop,
                                     Positions* positions) {
  const auto n = static_cast<VertexIndex>(rotations_.size());
  current_.setZero(4, n);
  current_.topRows<3>() = positions->transpose().cast<float>();
  if (!has_rotations_) StartRotations();
  const int turns = has_rotations_ ? kTurns : kFirstTurns;
  const auto fit = [&](std::int64_t task) {
    const auto first = static_cast<VertexIndex>(task) * kVerticesPerTask;
    const VertexIndex end = std::min(n, first + kVerticesPerTask);
    for (VertexIndex v = first; v < end; v += kLanes) {
      FitRotations(v, std::min(end, v + kLanes), turns);
    }
  };
  ISOMATCH_RETURN_IF_ERROR(
      ParallelFor((n + kVerticesPerTask - 1) / kVerticesPerTask, stop, fit));
  has_rotations_ = true;
  Eigen::Matrix3Xd right(3, n);
  ISOMATCH_RETURN_IF_ERROR(ParallelForVertices(n, stop, [&](VertexIndex v) {
    right.col(v) =
        pull_[v] * targets.row(v).transpose() + 0.5 * scale_ * RotatedEdges(v);
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
      const Eigen::Vector4f bent = rotations_[v] * edge.rest;
      const Eigen::RowVector3d bent_row = bent.head<3>().cast<double>();
      sum +=
          edge.weight *
          (positions.row(v) - positions.row(edge.to) - bent_row).squaredNorm();
    }
  }
  return 0.5 * sum;
}

}  // namespace isomatch
