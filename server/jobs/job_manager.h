#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "core/base/mutex.h"
#include "server/jobs/executor.h"
#include "server/jobs/job_queue.h"
#include "server/jobs/job_runner.h"
#include "server/jobs/job_spec.h"
#include "server/jobs/memory_budget.h"
#include "server/jobs/watchers.h"
#include "server/storage/blob_store.h"
#include "server/storage/job_store.h"

namespace isomatch {

/// A job as it is now.
struct JobSnapshot {
  JobRecord record;
  /// Jobs ahead of it while QUEUED.
  int queue_position = 0;
};

/// A part of a result, to be downloaded.
struct JobPart {
  /// Of the whole result.
  JobResult result;
  StoredPart part;
  BlobStore::Blob bytes;
};

/// Takes jobs in, starts them when there is a worker slot and memory for them,
/// and knows how each of them stands.
///
///            Create
///              |
///           QUEUED ------------------+--------------------+
///              | slot and memory     | queue timeout      | Cancel, Shutdown
///              v                     v                    v
///           RUNNING ------------> FAILED             CANCELLED
///              |    error, run timeout                    ^
///              |                                          |
///              +-------------- Cancel, Shutdown ----------+
///              v
///          SUCCEEDED
///
/// A job that is cancelled or timed out is terminal at once, whatever its
/// worker does; the slot and the memory come back when the match has returned.
///
/// Thread-safe. The mutex is never held while the store, a watcher, the match
/// or an executor is called.
class JobManager {
 public:
  struct Limits {
    /// Jobs that run at the same time; the executor has as many threads.
    int workers = 1;
    /// Jobs that wait. Their meshes take at most a quarter of the memory
    /// budget, unless there is only one.
    int max_queued_jobs = 100;
    /// Terminal jobs that are remembered, and the bytes of their results.
    int max_kept_jobs = 1000;
    std::int64_t max_result_bytes = std::int64_t{256} << 20;
    /// See JobQueue.
    int max_passes = 8;
  };

  /// What the manager works with; all outlive it except the executors, which
  /// are joined first.
  struct Parts {
    JobStore* jobs;
    BlobStore* blobs;
    MemoryBudget* budget;
    const JobRunner* runner;
    /// One thread for each worker slot.
    Executor* workers;
    /// For timeouts, so that they do not wait for a worker.
    Executor* timers;
    std::function<absl::Time()> now;
    /// Returns an id that was never used before.
    std::function<std::string()> new_id;
    /// Told of every change of state, for the log. May be empty.
    std::function<void(const JobRecord&)> on_state;
  };

  struct Load {
    int queued_jobs;
    int running_jobs;
    bool draining;
  };

  JobManager(const Limits& limits, const Parts& parts);

  /// Returns the job that the request with this id made before; nullopt for
  /// none or an empty id. ALREADY_EXISTS (REQUEST_ID_REUSED) when that was
  /// another request.
  absl::StatusOr<std::optional<JobSnapshot>> FindRequest(
      const std::string& request_id, const std::string& request_sha256) const;

  /// Accepts a job, or only checks it. The same request_id and request again
  /// return the first job. UNAVAILABLE (DRAINING), RESOURCE_EXHAUSTED
  /// (QUEUE_FULL), FAILED_PRECONDITION (JOB_NEEDS_MORE_MEMORY_THAN_BUDGET),
  /// ALREADY_EXISTS (REQUEST_ID_REUSED).
  absl::StatusOr<JobSnapshot> Create(JobSpec spec);

  absl::StatusOr<JobSnapshot> Get(const std::string& id) const;
  std::vector<JobSnapshot> List(const JobFilter& filter) const;

  /// Makes the job CANCELLED. NOT_FOUND; FAILED_PRECONDITION (JOB_TERMINAL).
  absl::StatusOr<JobSnapshot> Cancel(const std::string& id);

  /// Forgets a terminal job. NOT_FOUND; FAILED_PRECONDITION (JOB_NOT_TERMINAL).
  absl::Status Delete(const std::string& id);

  /// Returns a part of the result. NOT_FOUND (JOB_NOT_FOUND,
  /// RESULT_PART_MISSING); FAILED_PRECONDITION (JOB_NOT_SUCCEEDED).
  absl::StatusOr<JobPart> GetPart(const std::string& id, ResultPart part) const;

  /// Who is told of changes; see there.
  Watchers& watchers() { return watchers_; }

  Load load() const;

  /// From now on Create answers DRAINING; queued jobs become CANCELLED.
  void BeginDrain();

  /// BeginDrain; waits up to `drain` for running jobs, then cancels them and
  /// waits until no worker has one.
  void Shutdown(absl::Duration drain);

 private:
  using Edit = std::function<absl::Status(JobRecord&)>;

  // A job's way in.
  std::shared_ptr<LiveJob> MakeLive(JobSpec spec) const;
  JobRecord NewRecord(const LiveJob& live) const;
  absl::Status TakePlace(const LiveJob& live);
  void GivePlaceBack(const LiveJob& live);
  absl::StatusOr<JobSnapshot> Accept(const std::shared_ptr<LiveJob>& live);
  void Enqueue(const std::shared_ptr<LiveJob>& live);

  // Running it.
  void Dispatch();
  std::shared_ptr<LiveJob> TakeNext();
  void Run(std::shared_ptr<LiveJob> live);
  absl::Status Start(LiveJob& live);
  void ReportProgress(const std::string& id, const JobProgress& progress);
  void Finish(const std::string& id, absl::StatusOr<RunOutcome> outcome);
  absl::Status Succeed(const std::string& id, RunOutcome outcome);
  absl::Status StoreParts(std::vector<EncodedPart> parts, JobResult& result);
  void Fail(const std::string& id, const absl::Status& error);
  void ReleaseSlot(std::shared_ptr<LiveJob> live);

  // Ending it early.
  absl::Status Stop(const std::string& id, JobState to, const Edit& edit);
  void FailIfStill(JobState state, const std::string& id,
                   const absl::Status& error);
  bool WaitUntilIdle(absl::Duration timeout);
  std::vector<std::string> LiveIds() const;

  /// Applies `edit` to the newest record, again if another change came first,
  /// and tells the watchers.
  absl::StatusOr<JobRecord> Change(const std::string& id, const Edit& edit);

  /// The one function that changes a job's state. FAILED_PRECONDITION when the
  /// drawing above has no such arrow.
  absl::Status Move(const std::string& id, JobState to, const Edit& edit);

  JobSnapshot SnapshotOf(JobRecord record) const;

  /// Lets go of the parts that StoreParts stored.
  void UnpinParts(const JobResult& result);

  /// Lets go of the results of jobs that are gone.
  void Forget(const std::vector<JobRecord>& removed);

  const Limits limits_;
  const Parts parts_;
  Watchers watchers_;

  mutable Mutex mutex_;
  CondVar idle_;
  JobQueue queue_ ABSL_GUARDED_BY(mutex_);
  /// Jobs between TakePlace and Enqueue, and their meshes.
  int arriving_ ABSL_GUARDED_BY(mutex_) = 0;
  std::int64_t arriving_bytes_ ABSL_GUARDED_BY(mutex_) = 0;
  /// Those that are queued or have a worker.
  std::unordered_map<std::string, std::shared_ptr<LiveJob>> live_
      ABSL_GUARDED_BY(mutex_);
  int running_ ABSL_GUARDED_BY(mutex_) = 0;
  bool draining_ ABSL_GUARDED_BY(mutex_) = false;
};

}  // namespace isomatch
