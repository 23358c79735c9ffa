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
inline constexpr std::int32_t kNoStage = 0;

/// The last progress report. `stage` is the number of core/pipeline's Stage,
/// which never changes.
struct JobProgress {
  std::int32_t stage = kNoStage;
  double stage_fraction = 0;
  double total_fraction = 0;
  bool has_map = false;
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

/// The parts that a result can have; core/io/result_bytes.h tells what
/// their bytes are. The values go to disk and never change.
enum class ResultPart : std::int32_t {
  kMap = 1,             ///< every result has it
  kPreciseMap = 2,      ///< points between the vertices of Y
  kConfidence = 3,      ///< of each vertex's image
  kAlternativeMap = 4,  ///< the best of the maps that were not chosen
  kFunctionalMap = 5,   ///< on request
  kMaskY = 6,           ///< which vertices of Y have a counterpart
};

/// "MAP", "PRECISE_MAP", ...
inline const char* ResultPartName(ResultPart part) {
  constexpr const char* kNames[] = {
      "UNSPECIFIED",    "MAP",   "PRECISE_MAP", "CONFIDENCE", "ALTERNATIVE_MAP",
      "FUNCTIONAL_MAP", "MASK_Y"};
  return kNames[static_cast<int>(part)];
}

/// A part whose bytes are in the blob store.
struct StoredPart {
  ResultPart part = ResultPart::kMap;
  std::string sha256;
  std::int64_t bytes = 0;
};

/// All about a result but its parts' bytes.
struct JobResult {
  /// By increasing number, the map first.
  std::vector<StoredPart> parts;
  std::vector<StageSeconds> stage_times;
  double run_seconds = 0;
  std::int64_t peak_resident_bytes = 0;
  /// What is told about meshes and map, as bytes that this layer does not look
  /// into: see server/convert/result_info.h.
  std::string info;
  /// Set instead in records that were written before there was `info`: CBOR.
  std::string old_info;
};

/// Returns the part, or null when the result has none of that kind.
inline const StoredPart* FindPart(const JobResult& result, ResultPart part) {
  for (const StoredPart& stored : result.parts) {
    if (stored.part == part) return &stored;
  }
  return nullptr;
}

/// All that is remembered of a job. Meshes are blobs.
struct JobRecord {
  std::string id;
  /// As Caller::tenant.
  std::string tenant;
  JobState state = JobState::kQueued;
  JobProgress progress;
  std::int64_t memory_estimate_bytes = 0;
  std::optional<JobError> error;
  std::optional<JobResult> result;
  absl::Time create_time = absl::InfinitePast();
  absl::Time start_time = absl::InfinitePast();
  absl::Time end_time = absl::InfinitePast();
  /// The same by a clock that is never set, if it ended in this process; not
  /// kept on disk.
  absl::Duration end_steady = -absl::InfiniteDuration();
  /// What its age counts from, if it ended: end_time, or later when the clock
  /// was not believed then. Past in records of before there was this.
  absl::Time aged_from = absl::InfinitePast();
  std::map<std::string, std::string> labels;
  /// Empty for none; otherwise no other job of the tenant has it.
  std::string request_id;
  /// The x-request-id of the CreateJob call; of the log, not of the job.
  std::string call_id;
  /// The W3C traceparent of that call, "" for none; of the log, too.
  std::string trace_parent;
  /// SHA-256 of the request that came with `request_id`.
  std::string request_sha256;
  /// Jobs of a higher one start first: of the tenant, and, as far as its key
  /// allows, of all tenants.
  std::int32_t priority = 0;
  std::int32_t shared_priority = 0;
  /// Threads that memory_estimate_bytes counts with; 0 as of a run.
  std::int32_t threads = 0;
  /// How often it was started, but for starts that ended because the server
  /// stopped.
  std::int32_t attempt = 0;
  /// How often it took the server down or did not stop when asked to.
  std::int32_t faults = 0;
  /// Asked to stop it did not: its worker was given up.
  bool unresponsive = false;
  /// Not set means no limit. The first counts from create_time.
  std::optional<absl::Duration> queue_timeout;
  std::optional<absl::Duration> run_timeout;
  /// When the best map there is has to do, from the job's start on. Not set:
  /// never.
  std::optional<absl::Duration> deadline;
  /// Cancelled once nobody has watched it for a while.
  bool cancel_when_unwatched = false;
  /// SHA-256 of the blobs that running it needs, pinned until it is terminal:
  /// the request without its meshes, then the meshes.
  std::vector<std::string> inputs;

  // Given by the store.

  /// Grows with every change of any job.
  std::uint64_t sequence = 0;
  /// Order of creation.
  std::uint64_t number = 0;
  /// Of a SharedJobStore, while RUNNING: which process runs it, and the number
  /// of its claim, which no other has.
  std::string worker;
  std::uint64_t claim = 0;
  /// Of a SharedJobStore, while QUEUED: it waits for something that is missing.
  bool is_held = false;
  /// Of a SharedJobStore: how often that was so.
  int times_held = 0;
  /// Of a SharedJobStore: how often in a row since its inputs could not be
  /// read.
  int unreadable = 0;
  /// How long it is to be held once it is QUEUED again; of changes only.
  absl::Duration hold = absl::ZeroDuration();
  /// Why; of changes only.
  std::string hold_reason;
};

}  // namespace isomatch
