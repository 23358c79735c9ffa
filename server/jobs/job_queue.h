#pragma once

#include <cstdint>
#include <list>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>

#include "server/jobs/executor.h"
#include "server/jobs/job_spec.h"
#include "server/jobs/memory_budget.h"

namespace isomatch {

/// A job that is not terminal, with what it needs to run. The job's worker owns
/// it once it has left the queue; others only use `id` and `stop`.
struct LiveJob {
  std::string id;
  JobSpec spec;
  /// Of the meshes alone, and of all that the job may need.
  std::int64_t mesh_bytes = 0;
  std::int64_t memory_estimate_bytes = 0;
  /// Jobs that were started before this one although they came later.
  int passes = 0;
  MemoryBudget::Reservation reservation;
  std::stop_source stop;
  /// Of the queue timeout, then of the run timeout.
  Executor::Timer timer;

  /// Gives back meshes, reservation and timer.
  void Release() {
    spec = JobSpec();
    reservation = MemoryBudget::Reservation();
    timer.reset();
  }
};

/// Waiting jobs, first come first served, except that a job which fits the
/// memory budget may pass those before it that do not fit yet - each of them
/// `max_passes` times at most, so that a large job is not passed for ever.
///
/// Not thread-safe.
class JobQueue {
 public:
  explicit JobQueue(int max_passes) : max_passes_(max_passes) {}

  void Push(std::shared_ptr<LiveJob> job);

  /// Removes the next job that may start, with its reservation made; null when
  /// there is none.
  std::shared_ptr<LiveJob> PopFitting(MemoryBudget& budget);

  /// Removes a job wherever it stands; null when it is not there.
  std::shared_ptr<LiveJob> Remove(const std::string& id);

  /// Removes the first job; null when empty.
  std::shared_ptr<LiveJob> PopFront();

  /// Returns the number of jobs ahead of this one, 0 when it is not there.
  int JobsAhead(const std::string& id) const;

  int size() const { return static_cast<int>(jobs_.size()); }

  /// Of the meshes of all waiting jobs.
  std::int64_t mesh_bytes() const { return mesh_bytes_; }

 private:
  using Jobs = std::list<std::shared_ptr<LiveJob>>;

  std::shared_ptr<LiveJob> Take(Jobs::iterator position);

  const int max_passes_;
  Jobs jobs_;
  std::int64_t mesh_bytes_ = 0;
};

}  // namespace isomatch
