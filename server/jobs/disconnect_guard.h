#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <unordered_map>
#include <utility>

#include "absl/time/time.h"
#include "core/base/mutex.h"
#include "server/jobs/watchers.h"
#include "server/machine/executor.h"

namespace isomatch {

/// Cancels jobs that nobody watches any more.
///
///   1. Guard: the grace period of a job begins.
///   2. OnUnwatched: its last watcher has gone, the period begins anew.
///   3. The period ends: the job is cancelled, unless somebody watches it; then
///      the next period begins when the last watcher goes.
///   4. Release: the job is terminal, it is left alone.
///
/// Thread-safe. No lock is held while it calls others.
class DisconnectGuard {
 public:
  /// Clients notice a lost connection at once, or by their pings, and try again
  /// with pauses of at most 2 s: ten seconds hold a few such attempts.
  static constexpr absl::Duration kGrace = absl::Seconds(10);

  /// `cancel` is called on a thread of `timers`, at most once for a job. All
  /// outlive this object, except that `timers` may be joined before.
  DisconnectGuard(absl::Duration grace, Executor* timers,
                  const Watchers* watchers,
                  std::function<void(const std::string& id)> cancel)
      : grace_(grace),
        timers_(timers),
        watchers_(watchers),
        cancel_(std::move(cancel)) {}

  /// Guards a job until Release.
  void Guard(const std::string& id);

  /// Nothing for a job that is not guarded.
  void OnUnwatched(const std::string& id);

  /// Nothing for a job that is not guarded.
  void Release(const std::string& id);

  /// Releases all, so that `timers` can be joined without waiting for them.
  void ReleaseAll();

 private:
  struct Entry {
    /// Number of the newest grace period; timers of older ones do nothing.
    std::uint64_t period = 0;
    Executor::Timer timer;
  };
  using Entries = std::unordered_map<std::string, Entry>;

  void BeginPeriod(const std::string& id);
  void OnPeriodOver(const std::string& id, std::uint64_t period);

  /// Returns the job's entry if `period` is its newest one, else null.
  Entry* Find(const std::string& id, std::uint64_t period)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  const absl::Duration grace_;
  Executor* const timers_;
  const Watchers* const watchers_;
  const std::function<void(const std::string& id)> cancel_;

  Mutex mutex_;
  std::uint64_t last_period_ ABSL_GUARDED_BY(mutex_) = 0;
  Entries entries_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace isomatch
