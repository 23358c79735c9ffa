#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "server/storage/job_record.h"
#include "server/storage/job_store.h"

namespace isomatch {

/// A worker that asks for a job.
struct ClaimRequest {
  /// A name that no other process has, this one's for as long as it runs.
  std::string worker;
  /// What it has left of what it may reserve.
  std::int64_t free_bytes = 0;
  std::int64_t total_bytes = 0;
  /// How long it is believed without a word.
  absl::Duration lease = absl::Seconds(15);
  int max_running_per_tenant = 0;
  /// How often a job that does not fit is passed by later ones.
  int max_passes = 8;
  /// How often a job is overtaken by those of a higher shared_priority.
  int max_overtakes = 8;
  /// Attempts after which a job runs alone, because nothing told why the
  /// earlier ones ended.
  int alone_after = 3;
  /// SHA-256 of meshes that it has prepared, and is quicker with.
  std::vector<std::string> meshes = {};
};

/// A job that a worker runs, as it tells the store.
struct LeasedJob {
  std::string id;
  std::uint64_t claim = 0;
  JobProgress progress;
};

/// How long a worker that says nothing counts as one.
inline constexpr absl::Duration kWorkerAge = absl::Seconds(30);

/// A process that takes jobs.
struct WorkerEntry {
  std::string worker;
  std::string version;
  /// Jobs at a time, and threads of each.
  int slots = 0;
  int threads = 0;
  /// What its jobs may reserve together: the most that one job may need.
  std::int64_t memory_bytes = 0;
};

/// How many jobs wait and run, of all processes.
struct QueueCounts {
  int queued = 0;
  int running = 0;
  std::map<std::int32_t, int> queued_by_priority;
  absl::Duration oldest_queued = absl::ZeroDuration();
};

/// What the operator of the store has to watch: the table of the jobs that are
/// not over, which every worker writes.
struct StoreFigures {
  std::int64_t live_rows = 0;
  /// Those that wait to be cleaned away.
  std::int64_t dead_rows = 0;
  /// With its indexes.
  std::int64_t table_bytes = 0;
  /// How long the oldest transaction of the database has been open: what it may
  /// still see cannot be cleaned away.
  absl::Duration oldest_transaction = absl::ZeroDuration();
};

/// A job store with its queue, which several processes share. Whoever runs a
/// job has a lease on it: a number that no other claim has (JobRecord::claim),
/// and a time until which it is believed. A change by a worker holds only while
/// the job has the worker's claim. All times are those of the store's clock.
/// Thread-safe; UNAVAILABLE from every function, as for JobStore.
class SharedJobStore : public JobStore {
 public:
  /// Makes the next job RUNNING, with one attempt more, and returns it. None
  /// when no job may start on this worker now.
  virtual absl::StatusOr<std::optional<JobRecord>> Claim(
      const ClaimRequest& request) = 0;

  /// The worker goes on with its jobs, this far. Returns the ids of those that
  /// are not its own any more: ended by others, or given to others.
  virtual absl::StatusOr<std::vector<std::string>> Renew(
      const std::vector<LeasedJob>& jobs, absl::Duration lease) = 0;

  /// Returns the RUNNING jobs whose workers have let the lease run out. None
  /// for the time of a lease after the store itself was away.
  virtual absl::StatusOr<std::vector<JobRecord>> Expired(
      absl::Duration lease) = 0;

  /// Makes the job of an expired lease QUEUED again; true unless its worker, or
  /// another process like this one, was quicker.
  virtual absl::StatusOr<bool> TakeBack(const JobRecord& job, int faults) = 0;

  /// Returns the QUEUED jobs that have waited longer than they want to.
  virtual absl::StatusOr<std::vector<JobRecord>> Overdue() = 0;

  /// Somebody watches these jobs, and is believed to for as long as `grace`.
  virtual absl::Status KeepWatched(const std::vector<std::string>& ids,
                                   absl::Duration grace) = 0;

  /// Returns the jobs that nobody watches any more, and that want to be
  /// cancelled then.
  virtual absl::StatusOr<std::vector<std::string>> Unwatched() = 0;

  /// Returns the sequences of those of the jobs that are not over.
  virtual absl::StatusOr<std::map<std::string, std::uint64_t>> LiveSequences(
      const std::vector<std::string>& ids) = 0;

  /// Returns the QUEUED jobs in the order in which they start, if each fits and
  /// none comes.
  virtual absl::StatusOr<std::vector<std::string>> InOrder() = 0;

  virtual absl::StatusOr<QueueCounts> Count() = 0;
  virtual absl::StatusOr<int> CountQueuedOf(const std::string& tenant) = 0;

  /// The worker is there; said again and again.
  virtual absl::Status Register(const WorkerEntry& entry) = 0;
  virtual absl::Status Unregister(const std::string& worker) = 0;

  /// Returns the workers that were heard of within `age`.
  virtual absl::StatusOr<std::vector<WorkerEntry>> Workers(
      absl::Duration age) = 0;

  /// Whether `holder` looks after this chore until it has not said so for
  /// `term`. Two that believe it do no harm.
  virtual absl::StatusOr<bool> HoldChore(const std::string& chore,
                                         const std::string& holder,
                                         absl::Duration term) = 0;

  // For its operator.

  /// FAILED_PRECONDITION, which says what to do: a newer program has changed
  /// the store to what this one does not know.
  virtual absl::Status CheckVersion() = 0;

  virtual absl::StatusOr<StoreFigures> Measure() = 0;

  /// Returns how many calls of this process the store has refused or not
  /// answered. Asks nothing.
  virtual std::int64_t errors() const = 0;
};

}  // namespace isomatch
