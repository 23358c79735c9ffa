#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/time/time.h"
#include "core/base/mutex.h"
#include "server/storage/process_trace.h"
#include "server/storage/shared_job_store.h"

namespace isomatch {

/// The jobs that have a worker: how long each has been silent, which of them
/// were asked to stop, and which of those did not answer. Thread-safe.
class RunningJobs {
 public:
  /// `clock` never goes back.
  explicit RunningJobs(std::function<absl::Duration()> clock)
      : clock_(std::move(clock)) {}

  /// `resident_bytes`: of the process when the job began.
  void Begin(const std::string& id, std::int64_t resident_bytes);
  void SetAttempt(const std::string& id, std::int32_t attempt);
  /// The job's lease on a SharedJobStore.
  void SetClaim(const std::string& id, std::uint64_t claim);
  void OnProgress(const std::string& id, const JobProgress& progress);

  /// Returns the jobs that have a claim, and how far they are.
  std::vector<LeasedJob> Leased() const;
  /// Returns the job's claim; 0 for none.
  std::uint64_t ClaimOf(const std::string& id) const;

  /// Why a job was asked to stop, when that was for memory: what was resident
  /// then.
  using ResidentBytes = std::optional<std::int64_t>;

  /// The first time counts.
  void OnAskedToStop(const std::string& id, ResidentBytes resident = {});

  bool WasAskedToStop(const std::string& id) const;

  /// Its worker is given up; false when it was before, has come back, or was
  /// not asked to stop, so that this is another run.
  bool SetStuck(const std::string& id);

  /// Returns what OnAskedToStop was told.
  ResidentBytes ResidentWhenAsked(const std::string& id) const;

  /// Returns whether it was stuck.
  bool End(const std::string& id);

  bool IsEmpty() const;

  /// Returns a trace of every job, also of the stuck ones.
  std::vector<JobTrace> Traces() const;

  /// Those that are not stuck.
  std::vector<std::string> Ids() const;

  /// Those that are not stuck and were asked to stop `grace` ago or earlier.
  std::vector<std::string> Unanswered(absl::Duration grace) const;

 private:
  struct Entry {
    std::int32_t attempt = 0;
    std::uint64_t claim = 0;
    JobProgress progress = {};
    absl::Duration heard = absl::ZeroDuration();
    std::int64_t resident_at_begin = 0;
    std::optional<absl::Duration> asked = {};
    bool is_stuck = false;
    ResidentBytes resident_when_asked = {};
  };

  const std::function<absl::Duration()> clock_;
  mutable Mutex mutex_;
  std::map<std::string, Entry> entries_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace isomatch
