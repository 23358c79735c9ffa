#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <unordered_map>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "core/base/mutex.h"
#include "server/jobs/blame.h"
#include "server/jobs/caller.h"
#include "server/jobs/disconnect_guard.h"
#include "server/jobs/job_queue.h"
#include "server/jobs/job_runner.h"
#include "server/jobs/job_spec.h"
#include "server/jobs/memory_budget.h"
#include "server/jobs/retention_clock.h"
#include "server/jobs/running_jobs.h"
#include "server/jobs/storage_gate.h"
#include "server/jobs/tenant_limits.h"
#include "server/jobs/watchers.h"
#include "server/machine/executor.h"
#include "server/machine/process_memory.h"
#include "server/storage/blob_store.h"
#include "server/storage/job_store.h"
#include "server/storage/process_trace.h"

namespace isomatch {

/// What a QUEUED job waits for. Numbered as Job.WaitReason of the API.
enum class WaitReason {
  kTurn = 0,     ///< a worker slot and memory
  kStorage = 1,  ///< results cannot be stored for now
  kInputs = 2,   ///< its meshes or its request cannot be read for now
};

/// A job as it is now.
struct JobSnapshot {
  JobRecord record;
  /// Jobs ahead of it while QUEUED.
  int queue_position = 0;
  WaitReason waiting_for = WaitReason::kTurn;
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
///            ^ | slot and memory     | queue timeout      | Cancel
///    stopped | v                     v                    v
///           RUNNING ------------> FAILED             CANCELLED
///              |    error, run timeout                    ^
///              |                                          |
///              +-------------------- Cancel --------------+
///              v
///          SUCCEEDED
///
/// A job that is cancelled or timed out is terminal at once, whatever its
/// worker does; the slot and the memory come back when the match has returned.
///
/// A job whose result the disk refuses, or whose inputs cannot be read just
/// now, goes back to QUEUED and starts again when that is over; its attempt
/// does not count. While nothing can be stored no job starts; one whose result
/// alone is too large for the disk waits alone.
///
/// With durable stores, jobs go back to QUEUED when the server stops, or starts
/// again after a crash, and run then; without, they become CANCELLED.
///
/// A worker that does not come back costs its job only. `unresponsive_grace`
/// after a job was asked to stop (Cancel, a limit, Shutdown, memory):
///   1. its record says `unresponsive`, and it has a fault more; if it is not
///      terminal it goes back to the queue of the next process, or is FAILED
///      (UNRESPONSIVE) after `max_faults` of them, or when there is no next;
///   2. another thread takes the worker's place. What the job has reserved
///      stays with it: others start while there is memory for them;
///   3. `on_give_up` is called (with durable stores: without, a new process
///      would know no job) when as many are stuck as there are workers, when
///      there is no thread for 2, or when all that waits is held up by a job
///      that needs what the stuck ones have. Otherwise the others pass that
///      job.
///
/// If its worker comes back after all and the job is QUEUED, it runs again.
///
/// The watch, several times a second, does that, and looks at the memory of the
/// process. Beyond its limit, when what was freed is given back, jobs are asked
/// to stop, one by one, the most silent first, and go back to the queue, with a
/// fault if memory fell with their end; if it did not, no job is stopped before
/// it grows on. After `max_faults` they are FAILED (OUT_OF_MEMORY). One that
/// does not answer for two seconds is stuck at once, and on_give_up called.
///
/// Thread-safe. The mutex is never held while the store, a watcher, the match
/// or an executor is called (but `disk`, which is asked nothing after Drain).
class JobManager {
 public:
  struct Limits {
    /// Jobs that run at the same time; the executor has as many threads.
    int workers = 1;
    /// Jobs that wait.
    int max_queued_jobs = 100;
    /// Terminal jobs that are remembered, for how long, and the bytes of their
    /// results; see KeptJobs.
    int max_kept_jobs = 1000;
    absl::Duration job_retention = absl::InfiniteDuration();
    std::int64_t max_result_bytes = std::int64_t{256} << 20;
    /// See JobQueue.
    int max_passes = 8;
    /// How often a job takes the server down, or does not stop when asked to.
    int max_faults = 3;
    /// How often a job is started that the server goes down with, whosever
    /// fault it is. From the fourth time on it runs alone, so that it is known.
    int max_attempts = 30;
    /// What a job may run, whatever it asked for.
    absl::Duration max_run_time = absl::InfiniteDuration();
    /// What a match may take to return once it was asked to stop.
    absl::Duration unresponsive_grace = absl::Seconds(10);
    /// The stores outlive the process.
    bool durable = false;
    /// See DisconnectGuard.
    absl::Duration unwatched_grace = DisconnectGuard::kGrace;
    /// Of those limits of all.
    TenantLimits tenant = {};
  };

  /// Memory of the process.
  struct MemoryFigures {
    std::int64_t resident_bytes = 0;
    /// What it should have at most, with all that is reserved now.
    std::int64_t expected_bytes = 0;
    /// Beyond it jobs are stopped.
    std::int64_t limit_bytes = 0;
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
    /// Reads a job again from its inputs.
    std::function<absl::StatusOr<JobSpec>(const JobRecord&)> load_spec;
    /// Told of every change of state, for the log. May be empty.
    std::function<void(const JobRecord&)> on_state;
    /// Told why results cannot be stored, then OK when they can again. May be
    /// empty.
    std::function<void(const absl::Status&)> on_storage = {};
    /// One thread for what waits for the disk; null: that of the timers.
    Executor* disk = nullptr;
    /// Null: the clock is always believed.
    RetentionClock* retention_clock = nullptr;

    // The watch; there is none when `watch` is null.

    Executor* watch = nullptr;
    std::function<MemoryFigures()> read_memory = {};
    /// Gives memory that was freed back to the system.
    std::function<void()> release_memory = ReleaseFreedMemory;
    /// Null without durable stores.
    TraceStore* traces = nullptr;
    /// Never goes back.
    std::function<absl::Duration()> uptime = {};
    /// Told of each worker that does not come back, and why the process should
    /// end and start again. May be empty.
    std::function<void(const JobRecord&)> on_stuck = {};
    std::function<void(const std::string& reason)> on_give_up = {};
  };

  struct Load {
    int queued_jobs;
    /// Without the stuck ones.
    int running_jobs;
    int stuck_jobs;
    bool draining;
    /// Those of the queued that wait for their inputs.
    int held_jobs;
    /// Whether results can be stored, as far as is known.
    bool can_store;
    /// Those of the queued that wait until they can.
    int held_for_storage;
  };

  JobManager(const Limits& limits, const Parts& parts);

  /// Takes up the jobs that the store has from an earlier process: those that
  /// were queued or running are queued, in their order. Of those that ran, the
  /// ones of WhoIsToBlame (blame.h) have a fault more; where it is known whose
  /// doing it was, the attempt of the others does not count. One with
  /// `max_faults`, or `max_attempts` starts, becomes FAILED
  /// (CRASHED_REPEATEDLY). From now on
  /// forgets old jobs by itself, and watches. Call once, before Create.
  void Begin();

  // The job of another tenant is NOT_FOUND, but for an administrator.

  /// Returns the job that the request with this id made before; nullopt for
  /// none or an empty id. ALREADY_EXISTS (REQUEST_ID_REUSED) when that was
  /// another request.
  absl::StatusOr<std::optional<JobSnapshot>> FindRequest(
      const Caller& caller, const std::string& request_id,
      const std::string& request_sha256) const;

  /// A place for one more job, given back when it goes.
  class Seat;
  using Place = std::shared_ptr<Seat>;

  /// Takes a place for a job of the caller: UNAVAILABLE (DRAINING),
  /// RESOURCE_EXHAUSTED (QUEUE_FULL, TENANT_QUOTA). Quick: spares the work of
  /// reading a request that has none. Null when there is none, but the
  /// request_id has made a job before.
  absl::StatusOr<Place> TakePlace(const Caller& caller,
                                  const std::string& request_id);

  /// Accepts a job, or only checks it; it is in the stores when this returns.
  /// The same request_id and request again return the first job. Errors as
  /// TakePlace, if `place` is null; FAILED_PRECONDITION
  /// (JOB_NEEDS_MORE_MEMORY_THAN_BUDGET, MESH_MISSING), ALREADY_EXISTS
  /// (REQUEST_ID_REUSED), UNAVAILABLE or RESOURCE_EXHAUSTED (STORAGE_FAILED).
  absl::StatusOr<JobSnapshot> Create(const Caller& caller, JobSpec spec,
                                     Place place = nullptr);

  absl::StatusOr<JobSnapshot> Get(const Caller& caller,
                                  const std::string& id) const;
  std::vector<JobSnapshot> List(const Caller& caller, JobFilter filter) const;

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

  /// Who is told of changes; see there.
  Watchers& watchers() { return watchers_; }

  Load load() const;

  /// How many jobs wait, by priority.
  std::map<std::int32_t, int> queued_by_priority() const;

  /// From now on Create answers DRAINING and no job starts. Without durable
  /// stores queued jobs become CANCELLED.
  void BeginDrain();

  /// BeginDrain; waits up to `drain` for running jobs, then stops them and
  /// waits until no worker has one that answers.
  void Shutdown(absl::Duration drain);

  /// Whether Shutdown is over: no job changes any more.
  bool has_stopped() const { return stopped_; }

 private:
  using Edit = std::function<absl::Status(JobRecord&)>;

  // A job's way in.
  absl::Status TakePlaceLocked(Seat& seat)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  absl::Status CheckPlaceLocked(const std::string& tenant) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void GivePlaceBack(const std::string& tenant);
  JobRecord NewRecord(const Caller& caller, const JobSpec& spec) const;
  absl::StatusOr<JobSnapshot> Accept(const Caller& caller, JobRecord record,
                                     std::vector<JobInput> inputs);
  absl::StatusOr<JobRecord> Store(JobRecord record,
                                  std::vector<JobInput> inputs);
  absl::Status StoreInputs(const JobRecord& record,
                           std::vector<JobInput> inputs);
  absl::Status StoreInput(const std::string& tenant, JobInput& input);
  void Enqueue(const JobRecord& record);
  std::shared_ptr<LiveJob> NewLive(const JobRecord& record);
  void PutInQueue(const std::shared_ptr<LiveJob>& live);
  void PushLocked(const std::shared_ptr<LiveJob>& live)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  // One that was there before; job_manager_begin.cc.
  Blame FindBlame(const std::vector<JobRecord>& records);
  void PinBlobs(const JobRecord& record);
  void TakeUp(const JobRecord& record, const Blame& blame);
  void ForgetOld();

  // Running it.
  void Dispatch();
  std::shared_ptr<LiveJob> TakeNext();
  /// A job waits for memory that only a new process will have.
  bool IsHeldUpByStuck() const;
  void Run(const std::shared_ptr<LiveJob>& live);
  absl::StatusOr<JobRecord> Start(LiveJob& live);
  absl::StatusOr<RunOutcome> Execute(const LiveJob& live,
                                     const JobRecord& record);
  void ReportProgress(const std::string& id, const JobProgress& progress);
  void FailToStart(const std::string& id, const absl::Status& error);
  void Finish(LiveJob& live, const JobRecord& record,
              absl::StatusOr<RunOutcome> outcome);
  void PutBack(const std::string& id);
  bool HasFreedMemory(const std::string& id);
  /// Once the worker of `before` has come back: if the store has the job as
  /// QUEUED, whoever made it so, it takes its old place.
  void EnqueueAgain(const LiveJob& before, bool is_held);
  absl::Duration RunLimit(std::optional<absl::Duration> asked) const;
  void LimitRun(LiveJob& live, const JobRecord& started);
  absl::Status Succeed(const JobRecord& record, RunOutcome outcome);
  absl::Status StoreParts(const std::string& tenant,
                          std::vector<EncodedPart> parts, JobResult& result);
  /// Unless its state is another than the record's by now.
  void Fail(const JobRecord& record, const absl::Status& error);
  void ReleaseSlot(const std::shared_ptr<LiveJob>& live);

  // Waiting for the disk.
  StorageGate::Parts MakeGateParts();
  /// Makes the job QUEUED again if `error` may pass; false if not.
  bool WaitForStorage(LiveJob& live, const JobRecord& record,
                      std::int64_t result_bytes, const absl::Status& error);
  void Hold(const std::shared_ptr<LiveJob>& live);
  /// When its time has come: lets it start, or looks first if there is room.
  void LetStart(const std::weak_ptr<LiveJob>& weak);
  void EndHold(LiveJob& live);
  bool IsHeldLocked(const std::shared_ptr<LiveJob>& live) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  Executor::Timer HoldTimer(const std::shared_ptr<LiveJob>& live,
                            int times_held);
  void OnDisk(std::function<void()> work);

  // Ending it early.
  absl::Status Stop(const std::string& id, JobState to, const Edit& edit = {});
  void FailIfStill(JobState state, const std::string& id,
                   const absl::Status& error);
  void StopRunning(const std::string& id);
  void AskToStop(const std::string& id,
                 RunningJobs::ResidentBytes resident = {});
  std::shared_ptr<LiveJob> Unqueue(const std::string& id);
  bool WaitUntilIdle(absl::Duration timeout);
  std::vector<std::string> LiveIds() const;

  // The watch; job_manager_watch.cc.
  void Watch();
  void WatchMemory(const MemoryFigures& memory);
  void OnNoAnswer(const std::string& id);
  bool SetStuck(const std::string& id);
  absl::StatusOr<JobRecord> RecordNoAnswer(const std::string& id);
  void ReplaceWorker();
  void WriteTrace(const MemoryFigures& memory);
  void GiveUp(const std::string& reason);
  MemoryFigures ReadMemory() const;
  /// ReadMemory, without what was freed if that counts; with what the process
  /// had beyond what was expected when no job ran.
  MemoryFigures ReadSettledMemory();
  /// A new process would have all the jobs.
  bool may_give_up() const {
    return limits_.durable && parts_.on_give_up != nullptr;
  }
  /// No worker has a job that answers, and what is known of the others is
  /// stored.
  bool is_idle() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    return running_ - stuck_ <= 0 && unrecorded_ == 0;
  }

  /// Returns the job if the caller may know of it.
  absl::StatusOr<JobRecord> Find(const Caller& caller,
                                 const std::string& id) const;

  /// Applies `edit` to the newest record, again if another change came first.
  absl::StatusOr<JobRecord> Replace(const std::string& id, const Edit& edit);

  /// Replace; tells the watchers.
  absl::StatusOr<JobRecord> Change(const std::string& id, const Edit& edit);

  /// The one function that changes a job's state. FAILED_PRECONDITION when the
  /// drawing above has no such arrow. on_state is told first, then the
  /// watchers: who hears of a job's end finds it counted.
  absl::StatusOr<JobRecord> Move(const std::string& id, JobState to,
                                 const Edit& edit = {});
  /// What follows from it, as far as there is memory.
  void OnMoved(const JobRecord& moved);

  JobSnapshot SnapshotOf(JobRecord record) const;

  /// Removes the parts that StoreParts stored, if nobody else has them, and
  /// lets go of what StoreInputs did.
  void RemoveParts(const std::string& tenant, const JobResult& result);
  void UnpinInputs(const JobRecord& record);

  /// Forgets the jobs that are too old or too many, and results of so many
  /// bytes.
  void Prune(std::int64_t room_bytes = 0);

  // What jobs age by.
  absl::Time BelievedTime() const;
  absl::Duration Uptime() const;

  /// Removes the results of jobs that are gone, and their requests.
  void Forget(const std::vector<JobRecord>& removed);
  /// Also the meshes that no other job names.
  void RemoveMeshes(const JobRecord& removed);

  const Limits limits_;
  const Parts parts_;
  StorageGate gate_;
  Watchers watchers_{[this](const std::string& id) { guard_.OnUnwatched(id); }};
  DisconnectGuard guard_;

  mutable Mutex mutex_;
  CondVar idle_;
  JobQueue queue_ ABSL_GUARDED_BY(mutex_);
  /// The tenants of the places that are taken, each as often as it has some.
  std::multiset<std::string> arriving_ ABSL_GUARDED_BY(mutex_);
  /// Those that are queued or have a worker.
  std::unordered_map<std::string, std::shared_ptr<LiveJob>> live_
      ABSL_GUARDED_BY(mutex_);
  /// With the stuck ones.
  int running_ ABSL_GUARDED_BY(mutex_) = 0;
  int stuck_ ABSL_GUARDED_BY(mutex_) = 0;
  /// What the stuck ones have reserved.
  std::int64_t stuck_bytes_ ABSL_GUARDED_BY(mutex_) = 0;
  /// Those of the stuck ones of which the store does not know yet.
  int unrecorded_ ABSL_GUARDED_BY(mutex_) = 0;
  /// Of the executor of workers.
  int threads_ ABSL_GUARDED_BY(mutex_);
  bool draining_ ABSL_GUARDED_BY(mutex_) = false;
  /// Until all jobs of an earlier process are queued, so that the order holds.
  bool is_beginning_ ABSL_GUARDED_BY(mutex_) = false;
  /// Of the next ForgetOld.
  Executor::Timer retention_timer_ ABSL_GUARDED_BY(mutex_);
  /// Of the next Watch.
  Executor::Timer watch_timer_ ABSL_GUARDED_BY(mutex_);
  bool has_given_up_ ABSL_GUARDED_BY(mutex_) = false;
  std::atomic<bool> stopped_ = false;
  /// Memory above the limit that stopping a job did not help against: no other
  /// is stopped for it.
  std::atomic<std::int64_t> tolerated_bytes_ = 0;
  // Only the watch uses these.
  bool is_trace_empty_ = true;
  /// What was resident when freed memory was given back last.
  std::int64_t settled_bytes_ = 0;
  /// What was resident when no job ran, beyond what was expected.
  std::int64_t idle_excess_bytes_ = 0;
  RunningJobs runs_;
};

}  // namespace isomatch
