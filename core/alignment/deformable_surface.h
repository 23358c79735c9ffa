#pragma once

#include <stop_token>
#include <vector>

#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>

#include "absl/status/status.h"
#include "absl/types/span.h"
#include "core/mesh/triangle_mesh.h"
#include "core/spectral/cotan_laplacian.h"

namespace isomatch {

/// The rotation R that maximizes trace(R^T covariance).
Eigen::Matrix3d BestRotation(const Eigen::Matrix3d& covariance);

/// A surface that bends freely and resists stretching: the as-rigid-as-possible
/// energy (Sorkine, Alexa 2007, Eq. 3)
///
///   E(V) = 1/2 sum_i sum_{j in N(i)} w_ij |(V_i - V_j) - R_i (P_i - P_j)|^2
///
/// of positions V over the rest positions P, with the best rotation R_i of each
/// vertex. w are cotangent weights, held within [0.01, 10] so that slivers
/// neither push nor lock.
///
/// Each Step moves V toward the minimum of
///
///   sum_i pull_i |V_i - target_i|^2 + stiffness 2 E(V).
///
/// Deterministic at any thread count. Not thread-safe.
class DeformableSurface {
 public:
  /// At rest, as `mesh` is. REQUIRES: `laplacian` is that of `mesh`.
  DeformableSurface(const TriangleMesh& mesh, const CotanLaplacian& laplacian);

  /// Fixes stiffness (> 0; a length squared times area per area: in units of
  /// area when pull is mass) and pulls (n, >= 0, not all 0 on any component),
  /// and factorizes. INTERNAL when that fails. Time as a sparse Cholesky.
  absl::Status SetPull(const Eigen::VectorXd& pull, double stiffness);

  /// One alternation: best rotations for *positions, but for a thousandth, then
  /// best positions for those. REQUIRES: SetPull, n x 3 both. CANCELLED after
  /// `stop`. Time O(n) and a solve.
  absl::Status Step(const Positions& targets, const std::stop_token& stop,
                    Positions* positions);

  /// E of the last Step, with its rotations and the positions given; the area
  /// of the surface is its scale.
  double Energy(const Positions& positions) const;

 private:
  /// An edge at rest, from a vertex to another. In single precision, as the
  /// rotations: what they are fitted to is no more exact.
  struct Edge {
    Eigen::Vector3f weighted;  ///< rest times weight
    VertexIndex to;
    Eigen::Vector3f rest;  ///< the vertex less the other
    float weight;
  };
  /// Columns padded to a register.
  using Rotation = Eigen::Matrix<float, 4, 3>;

  absl::Span<const Edge> EdgesOf(VertexIndex v) const {
    return absl::MakeConstSpan(edges_).subspan(
        first_edges_[v], first_edges_[v + 1] - first_edges_[v]);
  }
  /// sum w (V_i - V_j) (P_i - P_j)^T, which the rotation is fitted to.
  Rotation Covariance(VertexIndex v) const;
  /// Turns up to kLanes rotations toward the best ones.
  void FitRotations(VertexIndex begin, VertexIndex end, int turns);
  /// All of them to the one that is best for the whole surface.
  void StartRotations();
  /// sum w (R_i + R_j) (P_i - P_j).
  Eigen::Vector3d RotatedEdges(VertexIndex v) const;
  void Solve(Eigen::Matrix3Xd* right) const;

  std::vector<Edge> edges_;  ///< vertex by vertex
  std::vector<std::size_t> first_edges_;
  Eigen::Matrix4Xf current_;  ///< positions, for reading one by one
  Eigen::SparseMatrix<double> stiffness_;  ///< n x n, of the weights
  std::vector<Rotation> rotations_;
  bool has_rotations_ = false;
  Eigen::VectorXd pull_;
  double scale_ = 1;  ///< of the stiffness matrix
  Eigen::SimplicialLLT<Eigen::SparseMatrix<double>> cholesky_;
};

}  // namespace isomatch
