#include "core/spectral/wavelet_filter.h"

#include <gtest/gtest.h>

namespace isomatch {
namespace {

TEST(WaveletFilterTest, IsOneWhereFrequenciesAgree) {
  // Meyer wavelets are a tight frame: their squares sum to 1.
  const Eigen::VectorXd eigenvalues = Eigen::VectorXd::LinSpaced(60, 0, 500);
  for (const int scales : {2, 4, 6}) {
    const Eigen::MatrixXd filter =
        WaveletFilter(eigenvalues, eigenvalues, scales);
    for (int i = 0; i < 60; ++i) {
      EXPECT_NEAR(filter(i, i), 1, 1e-12) << scales << " scales, " << i;
    }
    EXPECT_LE(filter.maxCoeff(), 1 + 1e-12);
    EXPECT_GE(filter.minCoeff(), -1e-12);
    EXPECT_NEAR((filter - filter.transpose()).norm(), 0, 1e-12);
  }
}

TEST(WaveletFilterTest, IsZeroTwoOctavesApart) {
  Eigen::VectorXd low(2);
  low << 10, 100;
  Eigen::VectorXd high(1);
  high << 410;
  const Eigen::MatrixXd filter = WaveletFilter(low, high, 6);
  EXPECT_NEAR(filter(0, 0), 0, 1e-12);
  EXPECT_NEAR(filter(1, 0), 0, 1e-12);
}

TEST(WaveletFilterTest, DoesNotDependOnTheUnit) {
  const Eigen::VectorXd x = Eigen::VectorXd::LinSpaced(20, 0, 90);
  const Eigen::VectorXd y = Eigen::VectorXd::LinSpaced(25, 0, 110);
  EXPECT_NEAR((WaveletFilter(x, y, 6) - WaveletFilter(7 * x, 7 * y, 6)).norm(),
              0, 1e-12);
}

}  // namespace
}  // namespace isomatch
