#pragma once

#include <string>
#include <vector>

#include "core/pipeline/progress.h"

namespace isomatch::bench {

/// What one inner loop costs, alone on all cores.
struct KernelCost {
  std::string name;
  std::vector<Stage> stages;  ///< of which it is the inner loop
  std::string unit;           ///< of work
  double ns_per_unit = 0;     ///< wall, all cores
  double rate = 0;            ///< GFLOP/s, or GB/s of what must be read
  bool is_arithmetic = true;
};

/// Distance fields, eigenpairs, candidates and swap proposals of the first
/// insertion and nearest columns, on as many vertices as the default profile
/// solves on.
std::vector<KernelCost> MeasureKernels();

}  // namespace isomatch::bench
