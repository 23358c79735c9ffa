#pragma once

#include <atomic>
#include <functional>
#include <utility>

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "core/base/mutex.h"
#include "server/machine/executor.h"

namespace isomatch {

/// Whether anything can be stored, as far as is known. Once that failed it
/// tries a little, after 1 s, 2 s, ... up to every 30 s or less, until it can.
/// One result that is too large for the disk does not close it.
///
/// Thread-safe. Wherever memory ends, it is tried again as long as it is
/// closed.
class StorageGate {
 public:
  static constexpr absl::Duration kFirstProbe = absl::Seconds(1);
  static constexpr absl::Duration kLongestPause = absl::Seconds(30);

  struct Environment {
    Executor* timers;
    /// Runs what waits for the disk, here or elsewhere; not at all once Stop is
    /// called.
    std::function<void(std::function<void()>)> on_disk;
    /// Whether a little can be written.
    std::function<absl::Status()> probe;
    /// Told once why it closed, then OK once it is open again.
    std::function<void(const absl::Status&)> on_change;
    /// Between attempts.
    absl::Duration longest_pause = kLongestPause;
  };

  explicit StorageGate(Environment environment)
      : environment_(std::move(environment)) {}

  bool is_open() const { return is_open_; }

  /// Probes; what failed elsewhere may have been too large only. True if it is
  /// open now.
  bool Check();

  /// No more attempts; it stays as it is.
  void Stop();

 private:
  void Close(const absl::Status& why);
  void OnTimer();
  void Probe();
  /// Sets the next timer; it is there as long as the gate is closed.
  void ProbeLater() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  const Environment environment_;
  std::atomic<bool> is_open_ = true;
  Mutex mutex_;
  bool is_stopped_ ABSL_GUARDED_BY(mutex_) = false;
  absl::Duration pause_ ABSL_GUARDED_BY(mutex_) = kFirstProbe;
  Executor::Timer timer_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace isomatch
