#pragma once

#include <functional>
#include <vector>

namespace isomatch::bench {

/// Seconds since some moment, and of processor time over all threads.
double WallSeconds();
double CpuSeconds();

/// Wall seconds of the quickest of three runs.
double BestSeconds(const std::function<void()>& body);

/// The middle one of at least one value; of two in the middle their mean.
double MedianOf(std::vector<double> values);

/// What this machine can do now, all cores at once.
struct MachineLimits {
  double read_gb_per_s = 0;  ///< sum over an array that no cache holds
  double gflop_per_s = 0;    ///< single-precision product of square matrices
};
MachineLimits MeasureMachine();

}  // namespace isomatch::bench
