#pragma once

#include <atomic>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "server/engine/job_spec.h"
#include "server/jobs/blame.h"
#include "server/jobs/caller.h"
#include "server/jobs/cluster_member.h"
#include "server/jobs/disk_work.h"
#include "server/jobs/job_environment.h"
#include "server/jobs/job_execution.h"
#include "server/jobs/job_intake.h"
#include "server/jobs/job_lifecycle.h"
#include "server/jobs/job_retention.h"
#include "server/jobs/job_scheduler.h"
#include "server/jobs/job_watchdog.h"
#include "server/storage/blob_store.h"
#include "server/storage/job_record.h"
#include "server/storage/job_store.h"

namespace isomatch {

/// A part of a result, to be downloaded.
struct JobPart {
  /// The whole result, which the part belongs to.
  JobResult result;
  StoredPart part;
  BlobStore::Blob bytes;
};

/// Takes jobs in, starts them when there is a worker slot and memory for them,
/// and knows how each of them stands. What it consists of:
///
///   JobIntake      from a request to a job in the stores
///   JobScheduler   which job has a worker, and which is next
///   JobExecution   what a worker does with a job
///   JobWatchdog    looks after those that run
///   JobLifecycle   the states of jobs; a drawing is there
///   JobRetention   how long jobs and their bytes stay
///   ClusterMember  what it does for others, where a store is shared
///
/// each of which knows those below it.
///
/// A job that is cancelled or timed out is terminal at once, whatever its
/// worker does; the slot and the memory come back when the match has returned.
///
/// With durable stores, jobs go back to QUEUED when the server stops, or start
/// again after a crash, and run then; without, they become CANCELLED.
///
/// Thread-safe. No mutex is held while the store, a watcher, the match or an
/// executor is called (but `disk`, which is asked nothing after Drain).
class JobManager {
 public:
  explicit JobManager(JobEnvironment environment);

  /// Takes up the jobs that the store has from an earlier process: those that
  /// were queued or running are queued, in their order. Of those that ran, the
  /// ones of WhoIsToBlame (blame.h) have a fault more; where it is known whose
  /// doing it was, the attempt of the others does not count. One with
  /// `max_faults`, or `max_attempts` starts, becomes FAILED
  /// (CRASHED_REPEATEDLY). From now on forgets old jobs by itself, and watches.
  /// Call once, before Create. Of a store that others share, jobs are taken up
  /// one by one instead, by whoever has a place for them.
  void Begin();

  // The job of another tenant is NOT_FOUND, but for an administrator.

  /// Returns the job that the request with this id made before; nullopt for
  /// none or an empty id. ALREADY_EXISTS (REQUEST_ID_REUSED) when that was
  /// another request.
  absl::StatusOr<std::optional<JobSnapshot>> FindRequest(
      const Caller& caller, const std::string& request_id,
      const std::string& request_sha256) const {
    return intake_.FindRequest(caller, request_id, request_sha256);
  }

  /// Takes a seat in the queue for a job of the caller: UNAVAILABLE (DRAINING),
  /// RESOURCE_EXHAUSTED (QUEUE_FULL, TENANT_QUOTA). Quick: spares the work of
  /// reading a request that has none. Null when there is none, but the
  /// request_id has made a job before.
  absl::StatusOr<JobIntake::SeatPtr> TakeSeat(const Caller& caller,
                                              const std::string& request_id) {
    return intake_.TakeSeat(caller, request_id);
  }

  /// Accepts a job, or only checks it; it is in the stores when this returns.
  /// The same request_id and request again return the first job. Errors as
  /// TakeSeat, if `seat` is null; FAILED_PRECONDITION
  /// (JOB_NEEDS_MORE_MEMORY_THAN_BUDGET, MESH_MISSING), ALREADY_EXISTS
  /// (REQUEST_ID_REUSED), UNAVAILABLE or RESOURCE_EXHAUSTED (STORAGE_FAILED).
  absl::StatusOr<JobSnapshot> Create(const Caller& caller, JobSpec spec,
                                     JobIntake::SeatPtr seat = nullptr) {
    return intake_.Create(caller, std::move(spec), std::move(seat));
  }

  absl::StatusOr<JobSnapshot> Get(const Caller& caller,
                                  const std::string& id) const;
  absl::StatusOr<std::vector<JobSnapshot>> List(const Caller& caller,
                                                JobFilter filter) const;

  /// Makes the job CANCELLED. NOT_FOUND; FAILED_PRECONDITION (JOB_TERMINAL).
  absl::StatusOr<JobSnapshot> Cancel(const Caller& caller,
                                     const std::string& id);

  /// Forgets a terminal job and removes its result, its request and the meshes
  /// that no other job of its tenant names. NOT_FOUND; FAILED_PRECONDITION
  /// (JOB_NOT_TERMINAL).
  absl::Status Delete(const Caller& caller, const std::string& id);

  /// Returns a part of the result. NOT_FOUND (JOB_NOT_FOUND,
  /// RESULT_PART_MISSING); FAILED_PRECONDITION (JOB_NOT_SUCCEEDED); DATA_LOSS
  /// (CONTENT_LOST); UNAVAILABLE (CONTENT_UNAVAILABLE).
  absl::StatusOr<JobPart> GetPart(const Caller& caller, const std::string& id,
                                  ResultPart part) const;

  /// Those who follow jobs.
  Watchers& watchers() { return lifecycle_.watchers(); }

  JobLoad load() const { return scheduler_.load(); }

  /// What jobs may count on.
  WorkerFigures workers() const { return scheduler_.Workers(); }

  // What follows waits for nobody.

  JobLoad local_load() const { return scheduler_.local_load(); }

  /// How long ago the watchdog looked last; see JobWatchdog.
  absl::Duration SinceWatched() const { return watchdog_.SinceLooked(); }

  /// What is known of a store that others share, and of those; nullopt without.
  std::optional<ClusterView> cluster() const {
    if (environment_.shared == nullptr) return std::nullopt;
    return member_.view();
  }

  /// How many jobs wait, by priority; not of a store that others share.
  std::map<std::int32_t, int> queued_by_priority() const {
    return scheduler_.queued_by_priority();
  }

  /// From now on Create answers DRAINING and no job starts. Without durable
  /// stores queued jobs become CANCELLED.
  void BeginDrain();

  /// BeginDrain; waits up to `drain` for running jobs, then stops them and
  /// waits until no worker has one that answers.
  void Shutdown(absl::Duration drain);

  /// Whether Shutdown is over: no job changes any more.
  bool has_stopped() const { return stopped_; }

 private:
  // Of the process before this one, from what it left in the stores.
  Blame FindBlame(const std::vector<JobRecord>& records);
  void TakeUp(const JobRecord& record, const Blame& blame);

  void StopRunning(const std::string& id);

  const JobEnvironment environment_;
  DiskWork disk_;
  JobRetention retention_;
  JobLifecycle lifecycle_;
  JobScheduler scheduler_;
  JobWatchdog watchdog_;
  JobExecution execution_;
  JobIntake intake_;
  /// Does nothing without a store that others share.
  ClusterMember member_;
  std::atomic<bool> stopped_ = false;
};

}  // namespace isomatch
