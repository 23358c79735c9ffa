#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "absl/time/time.h"

namespace isomatch {

/// Where the server counts what happens. This class itself counts nothing, for
/// who wants no metrics. Thread-safe, as derived classes must be.
///
/// Strings become labels: they come from small fixed sets, never from a client.
class Metrics {
 public:
  virtual ~Metrics() = default;

  /// A job left the queue for a worker, after `waited`.
  virtual void JobStarted(absl::Duration /*waited*/) {}

  /// A job became terminal: its state, and the reason when it failed.
  virtual void JobEnded(const std::string& /*state*/,
                        const std::string& /*reason*/) {}

  /// How long a job that became terminal had a worker.
  virtual void JobRan(const std::string& /*state*/, absl::Duration /*ran*/) {}

  /// A stage of a job that succeeded.
  virtual void StageRan(const std::string& /*stage*/, absl::Duration /*ran*/) {}

  /// A job's memory estimate over the peak that was measured while it ran.
  virtual void JobMeasured(double /*estimate_ratio*/) {}

  /// A chunk of an upload arrived.
  virtual void Uploaded(std::int64_t /*bytes*/) {}

  // Where the queue is shared.

  /// The store has answered whether there is a job for a worker of this
  /// process: `jobs` is 0 or 1.
  virtual void Claimed(int /*jobs*/, absl::Duration /*took*/) {}

  /// It has not answered.
  virtual void ClaimFailed() {}

  /// A job that runs here was given to others, who had heard nothing of it.
  virtual void LeaseLost() {}

  /// A job was taken from a worker that was not heard of.
  virtual void LeaseExpired() {}

  /// A call was answered; `method` is "package.Service/Method".
  virtual void CallHandled(const std::string& /*method*/,
                           const std::string& /*code*/,
                           absl::Duration /*handled*/) {}
};

/// Returns the one object that counts nothing.
Metrics& NullMetrics();

/// What processes that share a database know of it and of each other.
struct ClusterFigures {
  /// Whether it answered when it was asked last.
  bool is_database_up = false;
  /// Calls of this process that it refused or did not answer.
  std::int64_t database_errors = 0;

  /// What it has told, of all processes.
  struct Told {
    int queued_jobs = 0;
    int running_jobs = 0;
    absl::Duration oldest_queued;
    int workers = 0;
    /// Of the table of the jobs that are not over.
    std::int64_t live_rows = 0;
    std::int64_t dead_rows = 0;
    std::int64_t table_bytes = 0;
    absl::Duration oldest_transaction;
  };
  /// Not set before it has told it, and when that was long ago.
  std::optional<Told> told = {};
};

/// What is true at one moment.
struct LoadFigures {
  /// Queued jobs of a priority below, at and above 0.
  int queued_low = 0;
  int queued_normal = 0;
  int queued_high = 0;
  /// Queued jobs that wait for room for their results, and for their inputs.
  int held_for_storage = 0;
  int held_for_inputs = 0;
  int running_jobs = 0;
  int stuck_workers = 0;
  int watchers = 0;
  /// Open ones, and since the start those that were refused.
  int connections = 0;
  std::int64_t refused_connections = 0;
  std::int64_t memory_budget_bytes = 0;
  std::int64_t memory_reserved_bytes = 0;
  /// The peak of the process since a job last started.
  std::int64_t memory_measured_bytes = 0;
  std::int64_t stored_bytes = 0;
  /// Bytes of the prepared meshes in memory; and how often since the start one
  /// was found in memory, on disk, or not at all.
  std::int64_t prepared_bytes = 0;
  std::int64_t prepared_in_memory = 0;
  std::int64_t prepared_on_disk = 0;
  std::int64_t prepared_missing = 0;
  /// Not set where no database is shared.
  std::optional<ClusterFigures> cluster = {};
};

}  // namespace isomatch
