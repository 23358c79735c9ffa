#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "server/engine/job_spec.h"
#include "server/jobs/disconnect_guard.h"
#include "server/jobs/job_runner.h"
#include "server/jobs/memory_budget.h"
#include "server/jobs/retention_clock.h"
#include "server/jobs/tenant_limits.h"
#include "server/machine/executor.h"
#include "server/machine/process_memory.h"
#include "server/metrics/metrics.h"
#include "server/storage/blob_store.h"
#include "server/storage/job_store.h"
#include "server/storage/process_trace.h"
#include "server/storage/shared_job_store.h"
#include "server/storage/upload_store.h"

namespace isomatch {

/// Starts of a job after which it runs alone: the server went down with it each
/// time, and nothing told whose fault it was.
inline constexpr int kAloneAfter = 3;

struct JobLimits {
  /// Jobs that run at the same time; the executor has as many threads. 0 for a
  /// process that leaves them to others.
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
  /// What one tenant may have within these limits.
  TenantLimits tenant = {};

  /// Returns what a job may run that asked for so much; infinite for no limit.
  absl::Duration RunTime(std::optional<absl::Duration> asked) const {
    return std::min(asked.value_or(absl::InfiniteDuration()), max_run_time);
  }
};

/// Memory of the process.
struct MemoryFigures {
  std::int64_t resident_bytes = 0;
  /// What it should have at most, with all that is reserved now.
  std::int64_t expected_bytes = 0;
  /// Beyond it jobs are stopped.
  std::int64_t limit_bytes = 0;
};

/// What JobManager works with. Everything outlives it except the executors,
/// whose threads are joined first.
struct JobEnvironment {
  JobLimits limits = {};

  JobStore* jobs = nullptr;
  /// The same store when other processes use it, too; null when it is this
  /// one's alone, which then has the queue.
  SharedJobStore* shared = nullptr;
  /// The name of this process among those, which no other has or had.
  std::string process = "";
  /// How long the others believe it without a word.
  absl::Duration lease = absl::Seconds(15);
  BlobStore* blobs = nullptr;
  /// Of uploads that broke off; null where they are in memory.
  UploadStore* broken_uploads = nullptr;
  MemoryBudget* budget = nullptr;
  /// Threads of each job.
  int threads_per_job = 1;
  const JobRunner* runner = nullptr;
  /// Reads a job again from its inputs.
  std::function<absl::StatusOr<JobSpec>(const JobRecord&)> load_spec;

  /// One thread for each worker slot.
  Executor* workers = nullptr;
  /// For timeouts, so that they do not wait for a worker.
  Executor* timers = nullptr;
  /// One thread for what waits for the disk; null: that is done in the thread
  /// that has it to do.
  Executor* disk = nullptr;
  /// For ClusterMember, which waits for the store; used with `shared` only.
  Executor* cluster = nullptr;
  /// For JobWatchdog; null: there is none.
  Executor* watch = nullptr;

  std::function<absl::Time()> now;
  /// Never goes back.
  std::function<absl::Duration()> uptime = [] {
    return absl::FromChrono(
        std::chrono::steady_clock::now().time_since_epoch());
  };
  /// Null: `now` is always believed.
  RetentionClock* retention_clock = nullptr;
  /// Returns an id that was never used before.
  std::function<std::string()> new_id;

  Metrics* metrics = &NullMetrics();

  std::function<MemoryFigures()> read_memory = [] { return MemoryFigures(); };
  /// Gives memory that was freed back to the system.
  std::function<void()> release_memory = ReleaseFreedMemory;
  /// Null without durable stores.
  TraceStore* traces = nullptr;

  /// Told of every change of state, for the log.
  std::function<void(const JobRecord&)> on_state = [](const JobRecord&) {};
  /// Told why results cannot be stored, then OK when they can again.
  std::function<void(const absl::Status&)> on_storage =
      [](const absl::Status&) {};
  /// Told of a job whose worker, named in the record, has not said anything for
  /// a lease: taken from that one, or by others from this process.
  std::function<void(const JobRecord&, bool is_ours)> on_lease_lost =
      [](const JobRecord&, bool) {};
  /// Told why the database that is shared cannot be used, then OK when it can
  /// again.
  std::function<void(const absl::Status&)> on_database =
      [](const absl::Status&) {};
  /// Told of each worker that does not come back.
  std::function<void(const JobRecord&)> on_stuck = [](const JobRecord&) {};
  /// Told why the process should end and start again. Empty where it cannot.
  std::function<void(const std::string& reason)> on_give_up = {};

  /// The time that jobs age by.
  absl::Time BelievedTime() const {
    return retention_clock == nullptr ? now() : retention_clock->Now();
  }

  /// The time that the age of what ends now counts from.
  absl::Time LatestTime() const {
    return retention_clock == nullptr ? now() : retention_clock->Latest();
  }

  /// A new process would have all the jobs.
  bool may_give_up() const { return limits.durable && on_give_up != nullptr; }
};

}  // namespace isomatch
