#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/jobs/job_environment.h"
#include "server/jobs/job_lifecycle.h"
#include "server/jobs/job_queue.h"
#include "server/jobs/job_retention.h"
#include "server/jobs/job_runner.h"
#include "server/jobs/job_scheduler.h"
#include "server/jobs/job_watchdog.h"
#include "server/storage/job_record.h"

namespace isomatch {

/// What a worker does with a job: RUNNING, the match, its result into the
/// stores, and the state that follows.
///
/// A job whose result the disk refuses, or whose inputs cannot be read just
/// now, goes back to QUEUED and starts again when that is over; its attempt
/// does not count. Thread-safe.
class JobExecution {
 public:
  JobExecution(const JobEnvironment& environment, JobLifecycle* lifecycle,
               JobRetention* retention, JobScheduler* scheduler,
               JobWatchdog* watchdog)
      : environment_(environment),
        lifecycle_(*lifecycle),
        retention_(*retention),
        scheduler_(*scheduler),
        watchdog_(*watchdog) {}

  /// Runs a job to its end. Its slot and its memory come back when the match
  /// has returned, whatever state the job is in by then.
  void Run(const std::shared_ptr<LiveJob>& live);

 private:
  /// How far a run came.
  struct Progress {
    /// Set once the job is RUNNING.
    std::optional<JobRecord> started;
    /// Bytes of the whole result, and the parts of it that are stored.
    std::int64_t result_bytes = 0;
    std::vector<StoredPart> stored;
  };

  /// From QUEUED to SUCCEEDED, or the error that ended it.
  absl::Status RunToEnd(LiveJob& live, Progress& progress);
  absl::StatusOr<JobRecord> Start(LiveJob& live);
  absl::StatusOr<JobRecord> MoveToRunning(const std::string& id);
  void LimitRunTime(LiveJob& live, const JobRecord& started);
  void ReportProgress(const std::string& id, const JobProgress& progress);
  /// The result of a match that has ended, and SUCCEEDED; may be called again.
  absl::Status StoreResult(const JobRecord& started, const RunOutcome& outcome,
                           Progress& progress);
  absl::Status StoreParts(const std::string& tenant,
                          const std::vector<EncodedPart>& parts,
                          Progress& progress);
  /// Returns what `store` returns once the store that others share answers,
  /// unless the job is asked to stop before.
  absl::Status WhenStoreAnswers(
      const LiveJob& live, const std::function<absl::Status()>& store) const;

  /// Gives the job that did not come to its end the state that follows. May be
  /// called again wherever it ended.
  void Settle(LiveJob& live, Progress& progress, const absl::Status& error);
  void PutBack(const JobRecord& started);
  /// Whether `error` may pass, so that the job waits; counts how often.
  bool MayWaitForStorage(LiveJob& live, const Progress& progress,
                         const absl::Status& error);
  /// Makes the job QUEUED again, for a later start.
  absl::Status Hold(const LiveJob& live, const JobRecord& started,
                    const absl::Status& error);
  /// What a job fails with that has waited for long enough, or cannot wait.
  static absl::Status FinalError(const LiveJob& live,
                                 const absl::Status& error);

  const JobEnvironment& environment_;
  JobLifecycle& lifecycle_;
  JobRetention& retention_;
  JobScheduler& scheduler_;
  JobWatchdog& watchdog_;
};

}  // namespace isomatch
