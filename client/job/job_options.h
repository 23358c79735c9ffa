#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "client/api/match_request.h"

namespace isomatch {

/// How a job is to be done, for every command that makes one. The names are
/// those of core/pipeline/match_options.h.
struct JobOptions {
  std::string profile = "default";
  std::string relation = "whole";
  std::string scale = "auto";
  std::uint64_t random_seed = 1;
  std::uint32_t threads = 0;
  std::optional<std::uint32_t> solved_vertices;
  std::uint64_t memory_limit_bytes = 0;
  absl::Duration deadline = absl::InfiniteDuration();
  std::int32_t priority = 0;
  bool landmarks_exact = false;
  /// The tolerance, as LoadMesh has it; "" for not at all.
  std::string weld;
};

/// Copies `options` to `request`; how vertices are welded does not concern it.
/// REQUIRES: relation and scale are names of one.
void SetJobOptions(const JobOptions& options, MatchRequest* request);

/// An error of the server about the options of a job, in words of the command
/// line: flags for fields, megabytes for bytes.
absl::Status InFlagWords(const absl::Status& status);

}  // namespace isomatch
