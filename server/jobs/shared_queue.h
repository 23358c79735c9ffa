#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <string>
#include <unordered_map>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "core/base/mutex.h"
#include "server/jobs/job_environment.h"
#include "server/jobs/job_queue.h"
#include "server/storage/shared_job_store.h"

namespace isomatch {

/// What jobs may count on.
struct WorkerFigures {
  /// Jobs at a time.
  int slots = 0;
  /// The most threads, and the most memory, that one job gets.
  int threads = 0;
  std::int64_t job_bytes = 0;
};

/// The queue that several processes share, as one of them sees it: what it asks
/// often is at most a second old. Thread-safe; no lock is held while the store
/// is called.
class SharedQueue {
 public:
  explicit SharedQueue(const JobEnvironment& environment)
      : environment_(environment) {}

  /// Returns the next job for this process, RUNNING in the store and with its
  /// memory reserved; null when there is none, or when another thread is asking
  /// at this moment (it asks once more then).
  std::shared_ptr<LiveJob> Claim();

  /// What the store said when it was last asked for one; OK before.
  absl::Status last_claim() const {
    MutexLock lock(mutex_);
    return last_claim_;
  }

  /// Returns the number of jobs ahead of a QUEUED one.
  int PositionOf(const std::string& id);

  /// How many jobs wait and run, of all processes.
  QueueCounts Counts();

  /// Returns how many jobs of the tenant wait; UNAVAILABLE.
  absl::StatusOr<int> CountQueuedOf(const std::string& tenant) const {
    return environment_.shared->CountQueuedOf(tenant);
  }

  /// Returns what all workers have; nothing when none is known.
  WorkerFigures Workers();

 private:
  /// A value of the store, and when it was asked for.
  template <typename Value>
  struct Recent {
    Value value = {};
    absl::Duration asked = -absl::InfiniteDuration();
  };

  /// Returns `recent`'s value, asked for again with `ask` if it is old; as it
  /// was when the store does not answer.
  template <typename Value, typename Ask>
  Value Refresh(Recent<Value>& recent, const Ask& ask);

  std::shared_ptr<LiveJob> ClaimOne();
  ClaimRequest MakeRequest();
  void Remember(const std::vector<std::string>& inputs);

  using Positions = std::shared_ptr<const std::unordered_map<std::string, int>>;

  const JobEnvironment& environment_;
  mutable Mutex mutex_;
  absl::Status last_claim_ ABSL_GUARDED_BY(mutex_);
  bool is_claiming_ ABSL_GUARDED_BY(mutex_) = false;
  bool is_asked_again_ ABSL_GUARDED_BY(mutex_) = false;
  /// SHA-256 of what the last jobs of this process had as inputs, the latest
  /// first: their meshes are likely to be prepared still.
  std::deque<std::string> meshes_ ABSL_GUARDED_BY(mutex_);
  Recent<Positions> positions_ ABSL_GUARDED_BY(mutex_);
  Recent<QueueCounts> counts_ ABSL_GUARDED_BY(mutex_);
  Recent<WorkerFigures> workers_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace isomatch
