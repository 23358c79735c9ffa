#pragma once

#include <map>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "client/api/match_request.h"
#include "client/job/job_options.h"
#include "client/job/match_files.h"

namespace CLI {
class App;
}  // namespace CLI

namespace isomatch {

/// What only a job on a server can have.
struct QueueFlags {
  std::vector<std::string> labels;
  std::string queue_timeout;
  std::string run_timeout;
};

// Each adds options to `command`, which does not outlive what it fills.

/// X, Y, --landmarks, --landmarks-x and --landmarks-y.
void AddPairOptions(CLI::App* command, std::string* x, std::string* y,
                    LandmarkPaths* landmarks);
void AddJobFlags(CLI::App* command, JobOptions* options);
void AddQueueFlags(CLI::App* command, QueueFlags* flags);

/// Copies what the flags say to `request`. INVALID_ARGUMENT names the flag that
/// has no duration or no KEY=VALUE.
absl::Status SetQueueFlags(const QueueFlags& flags, MatchRequest* request);

/// Returns the labels that KEY=VALUE words name. INVALID_ARGUMENT names `flag`.
absl::StatusOr<std::map<std::string, std::string>> ParseLabels(
    const std::string& flag, const std::vector<std::string>& words);

}  // namespace isomatch
