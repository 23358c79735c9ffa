#pragma once

#include <stop_token>

#include <Eigen/Core>

#include "absl/status/statusor.h"
#include "core/spectral/cotan_laplacian.h"

namespace isomatch {

/// The lowest eigenpairs of the Laplace-Beltrami operator.
struct SpectralBasis {
  /// k, ascending, >= 0 up to rounding; 1 / squared mesh units.
  Eigen::VectorXd eigenvalues;
  /// n x k, columns orthonormal in the mass: Phi^T M Phi = I. Signs, and bases
  /// of repeated eigenvalues, are arbitrary but reproducible.
  Eigen::MatrixXd functions;
  /// n, the lumped mass.
  Eigen::VectorXd mass;

  int size() const { return static_cast<int>(eigenvalues.size()); }
};

/// Vectors that Lanczos holds to find `count` pairs.
int LanczosSubspace(int count);

/// Whether a mesh of n vertices is solved densely instead.
bool IsSolvedDensely(double n, int count);

/// Returns the `count` lowest pairs, or all n when there are fewer, of
/// L phi = lambda M phi: of M^-1/2 L M^-1/2, by FilteredSubspace, with its
/// residuals, or where that fails, as where eigenvalues accumulate, by
/// shift-invert Lanczos (Spectra) with residuals of 1e-10 of the inverse's
/// eigenvalues, or 1e-4 after 20 restarts; small meshes are solved densely.
///
/// INTERNAL with the numbers when the factorization or Lanczos fails.
/// CANCELLED soon after `stop`. Memory O(n count), mostly 24 n count bytes
/// (blocks, pairs), 28 n count with Lanczos.
absl::StatusOr<SpectralBasis> ComputeSpectralBasis(
    const CotanLaplacian& laplacian, int count, const std::stop_token& stop);

}  // namespace isomatch
