#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <unordered_map>
#include <vector>

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "core/base/mutex.h"
#include "server/engine/job_spec.h"
#include "server/jobs/disk_work.h"
#include "server/jobs/job_environment.h"
#include "server/jobs/job_lifecycle.h"
#include "server/jobs/job_queue.h"
#include "server/jobs/running_jobs.h"
#include "server/jobs/shared_queue.h"
#include "server/jobs/storage_gate.h"
#include "server/storage/job_record.h"

namespace isomatch {

/// What a QUEUED job waits for. Numbered as Job.WaitReason of the API.
enum class WaitReason {
  kTurn = 0,     ///< a worker slot and memory
  kStorage = 1,  ///< results cannot be stored for now
  kInputs = 2,   ///< its meshes or its request cannot be read for now
};

/// Returns how long a job is held that was so this often before: twice as long
/// each time, up to half a minute.
absl::Duration HoldAfter(int times_held);

/// A job as it is now.
struct JobSnapshot {
  JobRecord record;
  /// Jobs ahead of it while QUEUED.
  int queue_position = 0;
  WaitReason waiting_for = WaitReason::kTurn;
};

struct JobLoad {
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

/// How full the queue is, for a job that wants to come.
struct QueueRoom {
  bool draining;
  int queued_jobs;
  /// Those of them that are the tenant's.
  int queued_of_tenant;
};

/// Which jobs of this process wait and which have a worker, and which is next:
/// one starts when there is a worker slot and memory for it, and results can be
/// stored. One whose result alone is too large for the disk, or whose inputs
/// cannot be read just now, is held: it waits alone.
///
/// A worker that does not come back is stuck. Another thread takes its place;
/// what its job has reserved stays with it, and the others start while there is
/// memory for them. on_give_up is called (with durable stores: without, a new
/// process would know no job) when as many are stuck as there are workers, when
/// there is no thread for another, or when all that waits is held up by a job
/// that needs what the stuck ones have. Otherwise the others pass that job.
///
/// With a store that others share, the queue is there: what waits is claimed
/// when there is a worker slot for it, and `live_` has what runs here.
///
/// Thread-safe. The mutex is never held while the store, a watcher, the match
/// or an executor is called.
class JobScheduler {
 public:
  using Edit = JobLifecycle::Edit;

  /// `run` is called on a thread of the workers for each job that starts; it
  /// calls Release and then Dispatch when it is done with it.
  JobScheduler(const JobEnvironment& environment, JobLifecycle* lifecycle,
               DiskWork* disk,
               std::function<void(const std::shared_ptr<LiveJob>&)> run);

  // Asking.

  /// With a store that others share it is asked for the queue.
  JobLoad load() const;
  /// The same of this process alone, which waits for nobody: no job is queued
  /// where the store is shared.
  JobLoad local_load() const;
  // Not of a store that others share: see ClusterView and SharedRoomFor.
  std::map<std::int32_t, int> queued_by_priority() const;
  /// Time O(log tenants), whatever the jobs are.
  QueueRoom RoomFor(const std::string& tenant) const;
  /// The same of a store that others share; UNAVAILABLE.
  absl::StatusOr<QueueRoom> SharedRoomFor(const std::string& tenant);
  JobSnapshot SnapshotOf(JobRecord record) const;
  /// What jobs may count on: of all workers, where a store is shared. While
  /// none of those is known, job_bytes is 0, and a job may need whatever it
  /// wants.
  WorkerFigures Workers() const;
  RunningJobs& runs() { return runs_; }

  // Starting.

  /// Until EndBegin nothing starts, so that all of an earlier process are
  /// queued, and the order holds.
  void Begin();
  void EndBegin();

  /// A QUEUED job takes its place, and starts when its turn has come. When that
  /// is now, it need not load what it is to run, if `spec` is that.
  void Enqueue(const JobRecord& record,
               std::unique_ptr<JobSpec> spec = nullptr);

  /// Once the worker of `before` has come back: if the store has the job as
  /// QUEUED, whoever made it so, it takes its old place; it is held if its
  /// inputs could not be read, or its result was too large.
  void EnqueueAgain(const LiveJob& before);

  /// What the SharedJobStore said when it was last asked for a job.
  absl::Status last_claim() const { return shared_queue_.last_claim(); }

  /// Whether jobs are taken from a SharedJobStore, as they are at first.
  void LetClaim(bool may_claim);

  /// Starts what can start now. JobWatchdog or ClusterMember calls it too, so
  /// that nothing waits for ever where memory ended on the way here.
  void Dispatch();

  /// The worker of a job has come back.
  void Release(const std::shared_ptr<LiveJob>& live);

  /// Looks whether anything can be stored, after that failed; nothing starts
  /// while it cannot.
  void CheckStorage() { (void)gate_.Check(); }

  // Ending early.

  /// Makes the job `to`, and stops or removes what is there of it.
  absl::Status Stop(const std::string& id, JobState to, const Edit& edit = {});

  /// Makes the job FAILED if it is in this state; in a store that others share,
  /// and RUNNING, only while it is this process's.
  void FailIfStill(JobState state, const std::string& id,
                   const absl::Status& error);

  /// Asks a job's match to return; `resident` when that is for memory.
  void AskToStop(const std::string& id,
                 RunningJobs::ResidentBytes resident = {});

  // Workers that do not come back.

  /// Counts the job's worker as stuck until ReplaceWorker as not recorded;
  /// false when it is no such worker (see RunningJobs::SetStuck).
  bool SetStuck(const std::string& id);

  /// Once the store knows of one that is stuck: another thread takes its place.
  void ReplaceWorker();

  /// Calls on_give_up, once.
  void GiveUp(const std::string& reason);

  // The end.

  /// From now on nothing starts. Without durable stores queued jobs become
  /// CANCELLED.
  void BeginDrain();

  /// Waits until no worker has a job that answers, and what is known of the
  /// others is stored; false when that took too long.
  bool WaitUntilIdle(absl::Duration timeout);

  /// The jobs that are queued or have a worker.
  std::vector<std::string> LiveIds() const;

 private:
  StorageGate::Environment MakeGateEnvironment();
  std::shared_ptr<LiveJob> NewLive(const JobRecord& record);
  void PutInQueue(const std::shared_ptr<LiveJob>& live);
  void PushLocked(const std::shared_ptr<LiveJob>& live)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  std::shared_ptr<LiveJob> TakeNext();
  std::shared_ptr<LiveJob> ClaimNext();
  /// A job waits for memory that only a new process will have.
  bool IsHeldUpByStuck() const;
  std::shared_ptr<LiveJob> FindLive(const std::string& id) const;
  std::shared_ptr<LiveJob> Unqueue(const std::string& id);

  void Hold(const std::shared_ptr<LiveJob>& live);
  /// When its time has come: lets it start, or looks first if there is room.
  void LetStart(const std::weak_ptr<LiveJob>& weak);
  void EndHold(LiveJob& live);
  bool IsHeldLocked(const std::shared_ptr<LiveJob>& live) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  Executor::Timer HoldTimer(const std::shared_ptr<LiveJob>& live,
                            int times_held);

  bool is_shared() const { return environment_.shared != nullptr; }
  bool has_free_worker() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    return running_ - stuck_ < environment_.limits.workers &&
           running_ < threads_;
  }
  bool is_idle() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    return running_ - stuck_ <= 0 && unrecorded_ == 0;
  }

  const JobEnvironment& environment_;
  JobLifecycle& lifecycle_;
  DiskWork& disk_;
  const std::function<void(const std::shared_ptr<LiveJob>&)> run_;
  StorageGate gate_;
  RunningJobs runs_;
  mutable SharedQueue shared_queue_;

  mutable Mutex mutex_;
  CondVar idle_;
  JobQueue queue_ ABSL_GUARDED_BY(mutex_);
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
  /// Threads of the executor that runs the jobs.
  int threads_ ABSL_GUARDED_BY(mutex_);
  bool draining_ ABSL_GUARDED_BY(mutex_) = false;
  bool may_claim_ ABSL_GUARDED_BY(mutex_) = true;
  bool is_beginning_ ABSL_GUARDED_BY(mutex_) = false;
  bool has_given_up_ ABSL_GUARDED_BY(mutex_) = false;
};

}  // namespace isomatch
