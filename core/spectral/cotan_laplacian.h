#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>

#include "core/mesh/triangle_mesh.h"

namespace isomatch {

/// The Laplace-Beltrami operator of piecewise linear functions.
struct CotanLaplacian {
  /// n x n, symmetric positive semi-definite: L_ij = -(cot a_ij + cot b_ij) / 2
  /// for neighbors, rows sum to 0. No unit.
  Eigen::SparseMatrix<double> stiffness;
  /// n, lumped: a third of the area around each vertex, squared mesh units.
  /// Positive; its sum is the surface area, but for the floor below.
  Eigen::VectorXd mass;
};

/// Returns stiffness and mass from edge lengths (Pinkall, Polthier 1993).
///
/// Slivers: all edges are first lengthened by the smallest amount that makes
/// every triangle inequality hold by 1e-4 mean edge lengths (intrinsic
/// mollification, Sharp and Crane 2020, Section 4.5), so that cotangents stay
/// bounded and L stays semi-definite. Masses are at least 1e-6 of the mean.
///
/// REQUIRES: a clean mesh. Time and memory O(n).
CotanLaplacian BuildCotanLaplacian(const TriangleMesh& mesh);

/// M^-1/2 L M^-1/2, L the stiffness and M the mass.
Eigen::SparseMatrix<double> NormalizedStiffness(
    const CotanLaplacian& laplacian);

}  // namespace isomatch
