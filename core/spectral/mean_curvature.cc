#include "core/spectral/mean_curvature.h"

#include <Eigen/SparseCholesky>

#include "absl/strings/str_cat.h"

namespace isomatch {

absl::StatusOr<Eigen::VectorXd> SmoothedMeanCurvature(
    const CotanLaplacian& laplacian, const Positions& positions,
    const Positions& normals, double radius) {
  // M times the curvature: the mass cancels against that of the diffusion.
  const Eigen::MatrixXd bent = laplacian.stiffness * positions;
  const Eigen::VectorXd integrated =
      0.5 * bent.cwiseProduct(normals).rowwise().sum();
  Eigen::SparseMatrix<double> diffusion = radius * radius * laplacian.stiffness;
  diffusion.diagonal() += laplacian.mass;
  const Eigen::SimplicialLLT<Eigen::SparseMatrix<double>> cholesky(diffusion);
  if (cholesky.info() != Eigen::Success) {
    return absl::InternalError(
        absl::StrCat("Cholesky factorization of the diffusion failed, ",
                     positions.rows(), " vertices, radius ", radius));
  }
  return cholesky.solve(integrated);
}

}  // namespace isomatch
