#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <stop_token>
#include <string>
#include <unordered_map>
#include <vector>

#include "server/engine/job_spec.h"
#include "server/jobs/memory_budget.h"
#include "server/machine/executor.h"
#include "server/storage/job_record.h"

namespace isomatch {

/// A job that is queued or has a worker.
struct LiveJob {
  std::string id;
  std::string tenant;
  /// Among the jobs of its tenant.
  std::int32_t priority = 0;
  /// The same as far as it counts among tenants.
  std::int32_t shared_priority = 0;
  /// Estimate of all the memory that the job may need.
  std::int64_t memory_estimate_bytes = 0;
  /// Jobs that were started before this one although they came after it.
  int passes = 0;
  /// Order of arrival, given by the queue once; 0 before.
  std::uint64_t arrival = 0;
  /// Whose turn it is; see JobQueue.
  struct Turn {
    /// Number of the tenant's last start among all; 0 for none.
    std::uint64_t last_served = 0;
    /// Starts of others of a higher shared_priority since then.
    int overtakes = 0;
  };
  /// The tenant's turn before the job started, and since it started.
  Turn turn_before;
  Turn turn;
  MemoryBudget::Reservation reservation;
  std::stop_source stop;
  std::stop_source hurry;  ///< see MatchControl
  /// It does not start for now; how often that was so.
  bool is_held = false;
  int times_held = 0;
  /// Why it is held: room for a result of so many bytes is missing, or 0 and
  /// its inputs could not be read this many times in a row.
  std::int64_t awaited_bytes = 0;
  int unreadable = 0;
  /// The record of one that a SharedQueue has claimed: RUNNING already.
  std::optional<JobRecord> claimed;
  /// What to run, where the job starts as soon as it was created; else null,
  /// and it is loaded.
  std::unique_ptr<JobSpec> spec;
  /// Runs out at the queue timeout or, once the job runs, at the run timeout.
  Executor::Timer timer;
  Executor::Timer deadline_timer;

  /// Stands where `other`, the same job, stood before it started.
  void TakePlaceOf(const LiveJob& other) {
    passes = other.passes;
    arrival = other.arrival;
    turn_before = other.turn_before;
    turn = other.turn;
    times_held = other.times_held;
    awaited_bytes = other.awaited_bytes;
    unreadable = other.unreadable;
  }

  /// Gives back the meshes, the reservation and the timers.
  void Release() {
    spec.reset();
    reservation = MemoryBudget::Reservation();
    timer.reset();
    deadline_timer.reset();
  }
};

/// Waiting jobs, in the order in which they may start. Each tenant has one job
/// that is next: of its highest priority the one that came first. Of these
/// starts
///
///   1. one that was overtaken kMaxOvertakes times, as below;
///   2. that of the highest shared_priority;
///   3. that of the tenant with the fewest running jobs;
///   4. that of the tenant that was served least recently, so that tenants
///      take turns on a single worker too;
///   5. the one that came first.
///
/// Each start of a job by 2 overtakes the tenants whose next job has a lower
/// shared_priority; a start of its own makes a tenant begin again. So nobody
/// waits for ever, whatever priorities others ask for.
///
/// A job which fits the memory budget may pass those before it that do not fit
/// yet - each of them `max_passes` times at most, so that a large job is not
/// passed for ever. A tenant of which `max_running_per_tenant` jobs run starts
/// none, and comes after all others. One that is held is passed by all, as if
/// it were not there.
///
/// Remembers every tenant that came; there are as many as API keys.
///
/// Not thread-safe.
class JobQueue {
 public:
  static constexpr int kMaxOvertakes = 8;
  static constexpr std::int64_t kAnyBytes =
      std::numeric_limits<std::int64_t>::max();

  JobQueue(int max_passes, int max_running_per_tenant)
      : max_passes_(max_passes),
        max_running_per_tenant_(max_running_per_tenant) {}

  /// Adds a job. One that PopFitting returned before and that did not run after
  /// all takes its old place again, and its tenant the turn that it had, unless
  /// another of its jobs started since; call OnEnded for it first. When there
  /// is no memory for it nothing has changed.
  void Push(std::shared_ptr<LiveJob> job);

  /// Removes the next job that may start, with its reservation made, and counts
  /// it as running; null when there is none. A job that needs more than
  /// `most_bytes` is passed by all. O(tenants) for each job that is looked at.
  std::shared_ptr<LiveJob> PopFitting(MemoryBudget& budget,
                                      std::int64_t most_bytes = kAnyBytes);

  bool Has(const std::string& id) const { return by_id_.count(id) > 0; }

  /// Whether a job that is not held needs more than this. O(jobs).
  bool HasLargerThan(std::int64_t bytes) const;

  /// One that is held need not be any more.
  void EndHold(LiveJob& job);

  /// A job that PopFitting returned has ended.
  void OnEnded(const std::string& tenant);

  /// Removes a job wherever it stands; null when it is not there.
  std::shared_ptr<LiveJob> Remove(const std::string& id);

  /// Removes any job; null when empty.
  std::shared_ptr<LiveJob> PopAny();

  /// Returns the number of jobs ahead of this one, 0 when it is not there: of
  /// those that start before it when all fit and nothing else comes or ends;
  /// of one that is held, all that are not. O(jobs x tenants) after a change,
  /// then O(1).
  int JobsAhead(const std::string& id) const;

  int size() const { return static_cast<int>(by_id_.size()); }

  /// How many of the jobs are held, for their inputs and for room.
  int CountHeld() const;
  int CountAwaitingRoom() const;

  /// How many jobs wait, by priority.
  std::map<std::int32_t, int> CountByPriority() const;

  /// Waiting jobs of one tenant.
  int CountOf(const std::string& tenant) const;

 private:
  using Job = std::shared_ptr<LiveJob>;
  struct InOwnOrder {
    bool operator()(const Job& a, const Job& b) const {
      return a->priority != b->priority ? a->priority > b->priority
                                        : a->arrival < b->arrival;
    }
  };
  using Jobs = std::set<Job, InOwnOrder>;

  struct Tenant {
    LiveJob::Turn turn;
    int running = 0;
    Jobs waiting;
  };
  /// A tenant in a walk, which looks ahead: `next` is its next job.
  struct Walker {
    LiveJob::Turn turn;
    int running;
    int max_running;
    Jobs::const_iterator next;
    Jobs::const_iterator end;

    bool may_start() const { return running < max_running; }

    /// It comes first.
    bool operator<(const Walker& other) const;
  };
  using Visit = std::function<bool(const Job&)>;

  /// Returns the first job from here on that is not held, or `end`.
  static Jobs::const_iterator FirstFree(Jobs::const_iterator from,
                                        Jobs::const_iterator end);

  /// Visits the jobs that are not held in order until `visit` returns false, as
  /// if each started.
  void Walk(const Visit& visit) const;

  /// Returns the tenants with a job that is not held.
  std::vector<Walker> Line() const;

  /// Gives the tenant of a job that starts its turn, which overtakes others.
  void Serve(LiveJob& job);

  const int max_passes_;
  const int max_running_per_tenant_;
  std::uint64_t last_arrival_ = 0;
  std::uint64_t last_served_ = 0;
  std::map<std::string, Tenant> tenants_;
  std::unordered_map<std::string, Job> by_id_;
  /// What JobsAhead answers; empty after a change.
  mutable std::unordered_map<std::string, int> positions_;
};

}  // namespace isomatch
