#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/time/time.h"

namespace isomatch {

/// Where a job stands. The values go to disk and never change.
enum class JobState : std::int32_t {
  kQueued = 1,     ///< accepted, waits for a worker slot or for memory
  kRunning = 2,    ///< a worker slot has it
  kSucceeded = 3,  ///< terminal; the result is in the blob store
  kFailed = 4,     ///< terminal; `error` says why
  kCancelled = 5,  ///< terminal; by the user, or because the server stopped
};

/// True when the state never changes again.
inline bool IsTerminal(JobState state) { return state >= JobState::kSucceeded; }

/// "QUEUED", "RUNNING", ...
inline const char* JobStateName(JobState state) {
  constexpr const char* kNames[] = {"UNSPECIFIED", "QUEUED", "RUNNING",
                                    "SUCCEEDED",   "FAILED", "CANCELLED"};
  return kNames[static_cast<int>(state)];
}

/// Before the first progress report.
inline constexpr std::int32_t kNoStage = -1;

/// The last progress report. `stage` is the number of core/pipeline's Stage.
struct JobProgress {
  std::int32_t stage = kNoStage;
  double stage_fraction = 0;
  double total_fraction = 0;
};

/// Why a job failed.
struct JobError {
  absl::StatusCode code = absl::StatusCode::kUnknown;
  /// UPPER_SNAKE_CASE, see server/jobs/errors.h.
  std::string reason;
  std::string message;
};

/// Wall time of one stage that ended.
struct StageSeconds {
  std::int32_t stage = kNoStage;
  double seconds = 0;
};

/// A mesh as the user is told about it.
struct MeshSummary {
  std::int64_t vertices = 0;
  std::int64_t faces = 0;
  double area = 0;  ///< squared mesh units
  std::vector<std::string> warnings;
};

/// All about a result but the map itself, which is in the blob store.
struct JobResult {
  MeshSummary mesh_x;
  MeshSummary mesh_y;
  /// Of the map's bytes: a little-endian uint32 for each vertex of X.
  std::string map_sha256;
  std::int64_t map_bytes = 0;
  std::int64_t unmatched = 0;
  double embedding_error = 0;  ///< Eq. 8, mean over pairs
  double objective = 0;        ///< Eq. 4, mean over pairs
  double orientation_score = 0;
  std::vector<StageSeconds> stage_times;
  double run_seconds = 0;
  std::int64_t peak_resident_bytes = 0;
  std::vector<std::string> warnings;
  std::int32_t profile = 0;  ///< the number of core/pipeline's Profile
  std::uint64_t random_seed = 0;
};

/// All that is remembered of a job. Meshes are not.
struct JobRecord {
  std::string id;
  JobState state = JobState::kQueued;
  JobProgress progress;
  std::int64_t memory_estimate_bytes = 0;
  std::optional<JobError> error;
  std::optional<JobResult> result;
  absl::Time create_time = absl::InfinitePast();
  absl::Time start_time = absl::InfinitePast();
  absl::Time end_time = absl::InfinitePast();
  std::map<std::string, std::string> labels;
  /// Empty for none; otherwise no other job has it.
  std::string request_id;
  /// SHA-256 of the request that came with `request_id`.
  std::string request_sha256;

  // Given by the store.

  /// Grows with every change of any job.
  std::uint64_t sequence = 0;
  /// Order of creation.
  std::uint64_t number = 0;
};

}  // namespace isomatch
