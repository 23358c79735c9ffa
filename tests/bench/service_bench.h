#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "core/pipeline/match_options.h"

namespace isomatch::bench {

struct ServiceSelection {
  /// Vertices a side of pairs of the sample animal.
  std::vector<int> sizes = {5000};
  /// Pairs of a job through the service and one without it.
  int jobs = 10;
  /// Jobs at the same time, of the server and without it.
  int workers = 1;
  /// Meshes that one template is matched with.
  int targets = 20;
};

/// Prints, for each size,
///
///   1. what the service costs: jobs through gRPC, of a real server with a data
///      directory, against the same ones by Match in this process with as many
///      threads, one after the other by turns; where that time goes;
///   2. what the prepared-mesh cache saves when one template is matched with
///      many targets.
///
/// Each job has meshes of its own (but the template), which are compressed
/// before the clock runs. INTERNAL when a map differs from what Match finds.
/// The same as JSON to `out_path` unless that is empty.
absl::Status RunService(const ServiceSelection& selection,
                        const MatchOptions& options,
                        const std::string& out_path);

}  // namespace isomatch::bench
