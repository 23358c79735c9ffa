#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "core/pipeline/match_options.h"

namespace isomatch::bench {

struct SpeedSelection {
  /// Vertices a side of pairs of the sample animal.
  std::vector<int> sizes;
  /// Folder with pairs in place of those (PairSelection::dir), or empty.
  std::string dir = {};
  std::string filter = {};
  /// A report of an earlier run to compare with, or empty.
  std::string against = {};
  /// Runs of which the median counts.
  int runs = 3;
};

/// Prints how near single kernels come to what the machine can do; for each
/// pair, measured in a process of its own, and stage the seconds, processor
/// time, time by unit of work and peak memory, the share of the machine's limit
/// that its kernels reach, the estimate of memory, the error, the time with
/// both meshes prepared; then the exponents fitted over the sizes from 5,000
/// on, or the mean of the pairs of a folder, and how all of it compares with
/// the earlier run. The same as JSON to `out_path` unless that is empty.
absl::Status RunSpeed(const SpeedSelection& selection,
                      const MatchOptions& options, const std::string& out_path);

}  // namespace isomatch::bench
