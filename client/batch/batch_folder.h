#pragma once

#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"

namespace isomatch {

/// One pair of a folder that `isomatch batch` wrote: its files, and what the
/// report says in short.
struct BatchFolderPair {
  /// X__Y.
  std::string name = {};
  std::string x = {};
  std::string y = {};
  std::string map = {};
  /// Empty where the batch wrote none.
  std::string precise = {};
  std::string confidence = {};
  std::string mask_y = {};
  std::string report = {};
  /// As VerdictLabel; empty in reports of versions that did not judge.
  std::string verdict = {};
  std::string reason = {};
  /// By the name of their column in summary.csv, those that are there.
  std::vector<std::pair<std::string, double>> figures = {};
  /// Why there is nothing to show; empty when there is.
  std::string failure = {};
};

/// Returns the pairs of a folder by name: those of its files X__Y.json, and of
/// summary.csv those that have none, as they failed or were not reached. A
/// report that cannot be read makes a pair with a failure.
///
/// INVALID_ARGUMENT, naming the folder: no pair, or it cannot be read.
absl::StatusOr<std::vector<BatchFolderPair>> ReadBatchFolder(
    const std::string& folder);

}  // namespace isomatch
