#pragma once

#include <Eigen/Core>

namespace isomatch {

/// Returns what a functional map C (rows: X's eigenfunctions, columns: Y's) is
/// multiplied with, entry by entry, to become one that preserves multiscale
/// spectral manifold wavelets (Hu, Li, et al., CVPR 2021):
///
///   sum_s g_s(Lambda_X) C g_s(Lambda_Y)  =  C * F,
///   F_ij = sum_s g_s(lambda_X,i) g_s(lambda_Y,j)
///
/// over a scaling function and `scales` - 1 Meyer wavelets g_s, a tight frame:
/// sum_s g_s^2 = 1. F is 1 where frequencies agree and falls to 0 where they
/// are an octave or two apart, which no near-isometry mixes.
///
/// Eigenvalues ascending, at least one each, scales >= 2.
Eigen::MatrixXd WaveletFilter(const Eigen::VectorXd& eigenvalues_x,
                              const Eigen::VectorXd& eigenvalues_y, int scales);

}  // namespace isomatch
