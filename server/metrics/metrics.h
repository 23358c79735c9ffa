#pragma once

#include <cstdint>
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

  /// A call was answered; `method` is "package.Service/Method".
  virtual void CallHandled(const std::string& /*method*/,
                           const std::string& /*code*/,
                           absl::Duration /*handled*/) {}
};

/// Returns the one object that counts nothing.
Metrics& NullMetrics();

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
};

}  // namespace isomatch
