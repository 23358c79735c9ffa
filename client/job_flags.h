#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "client/match_request.h"

namespace CLI {
class App;
}  // namespace CLI

namespace isomatch {

/// How a job is to be done, for every command that makes one.
struct JobFlags {
  std::string profile = "default";
  std::uint64_t random_seed = 1;
  std::uint32_t threads = 0;
  std::optional<std::uint32_t> solved_vertices;
  std::uint64_t memory_limit_bytes = 0;
  std::int32_t priority = 0;
  bool landmarks_exact = false;
  /// As --weld has it; "" for not at all.
  std::string weld;
};

/// What only a job on a server can have.
struct QueueFlags {
  std::vector<std::string> labels;
  std::string queue_timeout;
  std::string run_timeout;
};

// Each adds options to `command`, which does not outlive what it fills.

/// X, Y and --landmarks.
void AddPairOptions(CLI::App* command, std::string* x, std::string* y,
                    std::string* landmarks);
void AddJobFlags(CLI::App* command, JobFlags* flags);
void AddQueueFlags(CLI::App* command, QueueFlags* flags);

/// Copies what the flags say to `request`.
void SetJobFlags(const JobFlags& flags, MatchRequest* request);

/// As SetJobFlags. INVALID_ARGUMENT names the flag that has no duration or no
/// KEY=VALUE.
absl::Status SetQueueFlags(const QueueFlags& flags, MatchRequest* request);

/// Returns the labels that KEY=VALUE words name. INVALID_ARGUMENT names `flag`.
absl::StatusOr<std::map<std::string, std::string>> ParseLabels(
    const std::string& flag, const std::vector<std::string>& words);

/// The files that a match reads; `landmarks` and `weld` empty for none.
struct MatchFiles {
  std::string x;
  std::string y;
  std::string landmarks;
  std::string weld;
};

/// Reads both meshes and the landmarks, and returns Y with the faces of its
/// file, for what numbers them. What is to be said about the files is appended
/// to `warnings`. Errors name X, Y or the file's line.
absl::StatusOr<TriangleMesh> ReadInputs(const MatchFiles& files,
                                        MatchRequest* request,
                                        std::vector<std::string>* warnings);

/// An error of the server about the options of a job, in words of the command
/// line: flags for fields, megabytes for bytes.
absl::Status InFlagWords(const absl::Status& status);

}  // namespace isomatch
