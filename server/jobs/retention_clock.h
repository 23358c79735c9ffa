#pragma once

#include <functional>
#include <optional>
#include <string>
#include <utility>

#include "absl/time/time.h"
#include "core/base/mutex.h"

namespace isomatch {

/// What time may be believed, before something is deleted because it is old: a
/// machine that starts with a wrong clock is put right later, what was deleted
/// does not come back. A wall clock that is more than kJump away from what the
/// last process saw, or moves by more than that against the steady clock, is
/// believed once it has been steady for kGrace. Until then it is as late as the
/// time that was believed last, and what the steady clock has counted since,
/// at most: then all is only older than it seems.
///
/// Thread-safe.
class RetentionClock {
 public:
  static constexpr absl::Duration kJump = absl::Hours(1);
  /// A wrong clock is put right by then: a client of NTP that finds no server
  /// tries again each half an hour, a person on the next day.
  static constexpr absl::Duration kGrace = absl::Hours(24);

  struct Environment {
    std::function<absl::Time()> now;
    /// Since any moment; never set.
    std::function<absl::Duration()> steady;
    /// Remembers, across restarts, a time that was believed.
    std::function<void(absl::Time)> save;
    /// Told in words when the clock is not believed, and when it is again.
    std::function<void(bool is_believed, const std::string& why)> on_change;
  };

  /// `last_seen`: what was saved last, else the latest time of a job; not set
  /// when there is nothing.
  RetentionClock(Environment environment, std::optional<absl::Time> last_seen);

  /// Looks at the clocks. Never later than the wall clock.
  absl::Time Now() { return LookNow().earliest; }

  /// Looks at the clocks. Never earlier than the wall clock: the age of what
  /// begins now counts from then, or a clock that is put right makes it old.
  absl::Time Latest() { return LookNow().latest; }

 private:
  struct Reading {
    absl::Time wall;
    absl::Duration steady;
  };
  /// Between what it may be now.
  struct Bounds {
    absl::Time earliest;
    absl::Time latest;
  };
  Bounds LookNow();

  Reading Read() const { return {environment_.now(), environment_.steady()}; }

  /// What there is to say, if anything.
  std::string Look(const Reading& now) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  const Environment environment_;
  Mutex mutex_;
  Reading last_ ABSL_GUARDED_BY(mutex_);
  /// What was believed at `last_`.
  absl::Time believed_ ABSL_GUARDED_BY(mutex_);
  std::optional<absl::Time> saved_ ABSL_GUARDED_BY(mutex_);
  /// By the steady clock, since when the wall clock goes with it; not set while
  /// it is believed.
  std::optional<absl::Duration> steady_since_ ABSL_GUARDED_BY(mutex_);
  /// To be told at the next look.
  std::string at_start_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace isomatch
