#include "core/spectral/wavelet_filter.h"

#include <algorithm>
#include <cmath>

namespace isomatch {
namespace {

constexpr double kHalfPi = 1.5707963267948966;

/// Rises smoothly from 0 at 0 to 1 at 1 with v(t) + v(1 - t) = 1.
double Ramp(double t) {
  t = std::clamp(t, 0.0, 1.0);
  return t * t * t * t * (35 - 84 * t + 70 * t * t - 20 * t * t * t);
}

/// Low pass: 1 up to 2/3, 0 from 4/3 on.
double Scaling(double t) { return std::cos(kHalfPi * Ramp(1.5 * t - 1)); }

/// Band pass between 2/3 and 8/3, with its peak at 4/3.
double Wavelet(double t) {
  return t < 4.0 / 3 ? std::sin(kHalfPi * Ramp(1.5 * t - 1))
                     : std::cos(kHalfPi * Ramp(0.75 * t - 1));
}

/// One scale a column. The finest wavelet peaks at the largest eigenvalue.
Eigen::MatrixXd Responses(const Eigen::VectorXd& eigenvalues, double largest,
                          int scales) {
  Eigen::MatrixXd responses(eigenvalues.size(), scales);
  for (int s = 0; s < scales; ++s) {
    const double stretch =
        4.0 / (3.0 * largest) * std::pow(2.0, scales - 1 - std::max(s, 1));
    for (Eigen::Index i = 0; i < eigenvalues.size(); ++i) {
      const double t = stretch * std::max(0.0, eigenvalues[i]);
      responses(i, s) = s == 0 ? Scaling(t) : Wavelet(t);
    }
  }
  return responses;
}

}  // namespace

Eigen::MatrixXd WaveletFilter(const Eigen::VectorXd& eigenvalues_x,
                              const Eigen::VectorXd& eigenvalues_y,
                              int scales) {
  const double largest =
      std::max({eigenvalues_x.maxCoeff(), eigenvalues_y.maxCoeff(), 1e-12});
  return Responses(eigenvalues_x, largest, scales) *
         Responses(eigenvalues_y, largest, scales).transpose();
}

}  // namespace isomatch
