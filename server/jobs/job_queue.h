#pragma once

#include <cstdint>
#include <functional>
#include <list>
#include <map>
#include <memory>
#include <stop_token>
#include <string>
#include <unordered_map>

#include "server/jobs/executor.h"
#include "server/jobs/memory_budget.h"

namespace isomatch {

/// A job that is queued or has a worker.
struct LiveJob {
  std::string id;
  std::string tenant;
  std::int32_t priority = 0;
  /// Of all that the job may need.
  std::int64_t memory_estimate_bytes = 0;
  /// Jobs that were started before this one although they came after it.
  int passes = 0;
  MemoryBudget::Reservation reservation;
  std::stop_source stop;
  /// Of the queue timeout, then of the run timeout.
  Executor::Timer timer;

  /// Gives back reservation and timer.
  void Release() {
    reservation = MemoryBudget::Reservation();
    timer.reset();
  }
};

/// Waiting jobs, in the order in which they may start:
///
///   1. those of a higher priority first;
///   2. among them tenants in turns: the k-th waiting job of a tenant stands
///      where it has k - 1 jobs waiting before it and its running ones beside;
///   3. among those, first come first served.
///
/// A job which fits the memory budget may pass those before it that do not fit
/// yet - each of them `max_passes` times at most, so that a large job is not
/// passed for ever.
///
/// Not thread-safe.
class JobQueue {
 public:
  explicit JobQueue(int max_passes) : max_passes_(max_passes) {}

  void Push(std::shared_ptr<LiveJob> job);

  /// Removes the next job that may start, with its reservation made, and counts
  /// it as running; null when there is none. O(tenants) beside the jobs that
  /// are looked at.
  std::shared_ptr<LiveJob> PopFitting(MemoryBudget& budget);

  /// A job that PopFitting returned has ended.
  void OnEnded(const std::string& tenant);

  /// Removes a job wherever it stands; null when it is not there.
  std::shared_ptr<LiveJob> Remove(const std::string& id);

  /// Removes any job; null when empty.
  std::shared_ptr<LiveJob> PopAny();

  /// Returns the number of jobs ahead of this one, 0 when it is not there.
  int JobsAhead(const std::string& id) const;

  int size() const { return static_cast<int>(by_id_.size()); }

  /// How many jobs wait, by priority.
  std::map<std::int32_t, int> CountByPriority() const;

  /// Waiting jobs of one tenant.
  int CountOf(const std::string& tenant) const;

 private:
  struct Waiting {
    std::shared_ptr<LiveJob> job;
    /// Order of arrival.
    std::uint64_t number;
  };
  using Jobs = std::list<Waiting>;
  using Tenants = std::map<std::string, Jobs>;
  using Visit = std::function<bool(const std::shared_ptr<LiveJob>&)>;

  /// Visits the jobs in order until `visit` returns false.
  void Walk(const Visit& visit) const;
  /// The same among one priority; false when `visit` said so.
  bool WalkLevel(const Tenants& tenants, const Visit& visit) const;

  const int max_passes_;
  std::uint64_t last_number_ = 0;
  std::map<std::int32_t, Tenants, std::greater<>> levels_;
  std::unordered_map<std::string, Jobs::iterator> by_id_;
  /// Tenant -> jobs that run, that wait. Without zeros.
  std::unordered_map<std::string, int> running_;
  std::unordered_map<std::string, int> waiting_;
};

}  // namespace isomatch
