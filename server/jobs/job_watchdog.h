#pragma once

#include <atomic>
#include <cstdint>
#include <string>

#include "absl/status/statusor.h"
#include "core/base/mutex.h"
#include "server/jobs/job_environment.h"
#include "server/jobs/job_lifecycle.h"
#include "server/jobs/job_scheduler.h"
#include "server/storage/job_record.h"

namespace isomatch {

/// Looks after jobs that run, several times a second, so that a worker that
/// does not come back costs its job only, and memory beyond the process's limit
/// some job and not the process.
///
/// `unresponsive_grace` after a job was asked to stop (Cancel, a limit,
/// Shutdown, memory) its record says `unresponsive`, and it has a fault more.
/// If it is not terminal it goes back to the queue of the next process, or is
/// FAILED (UNRESPONSIVE) after `max_faults` of them, or when there is no next.
/// Its worker is stuck: see JobScheduler. If the worker comes back after all
/// and the job is QUEUED, it runs again.
///
/// Beyond the limit of memory, when what was freed is given back, jobs are
/// asked to stop, one by one, the most silent first, and go back to the queue,
/// with a fault if memory fell with their end; if it did not, no job is stopped
/// before it grows on. After `max_faults` they are FAILED (OUT_OF_MEMORY). One
/// that does not answer for two seconds is stuck at once, and on_give_up
/// called.
///
/// Waits for no store that others share, but to record that a worker is stuck:
/// a process whose store is away is well.
///
/// Thread-safe.
class JobWatchdog {
 public:
  JobWatchdog(const JobEnvironment& environment, JobLifecycle* lifecycle,
              JobScheduler* scheduler)
      : environment_(environment),
        lifecycle_(*lifecycle),
        scheduler_(*scheduler) {}

  /// Looks now, and again and again from now on.
  void Begin() { Watch(); }

  /// Does not look again.
  void Stop();

  /// How long ago it looked last: much more than a second when something hangs
  /// that jobs need.
  absl::Duration SinceLooked() const;

  /// The job's worker does not come back, if it was asked to stop.
  void OnNoAnswer(const std::string& id);

  /// Whether the end of this job, which was asked to stop for memory, has freed
  /// some.
  bool HasFreedMemory(const std::string& id);

 private:
  void Watch();
  void WatchMemory(const MemoryFigures& memory);
  absl::StatusOr<JobRecord> RecordNoAnswer(const std::string& id);
  void WriteTrace(const MemoryFigures& memory);
  /// What is read, without what was freed if that counts; with what the process
  /// had beyond what was expected when no job ran.
  MemoryFigures ReadSettledMemory();

  const JobEnvironment& environment_;
  JobLifecycle& lifecycle_;
  JobScheduler& scheduler_;
  /// Memory above the limit that stopping a job did not help against: no other
  /// is stopped for it.
  std::atomic<std::int64_t> tolerated_bytes_ = 0;
  // Only Watch uses these.
  bool is_trace_empty_ = true;
  /// What was resident when freed memory was given back last.
  std::int64_t settled_bytes_ = 0;
  /// What was resident when no job ran, beyond what was expected.
  std::int64_t idle_excess_bytes_ = 0;

  mutable Mutex mutex_;
  absl::Duration looked_ ABSL_GUARDED_BY(mutex_) = -absl::InfiniteDuration();
  bool is_stopped_ ABSL_GUARDED_BY(mutex_) = false;
  /// Runs the next Watch.
  Executor::Timer timer_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace isomatch
