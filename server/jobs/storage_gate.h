#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <utility>

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "core/base/mutex.h"
#include "server/jobs/executor.h"

namespace isomatch {

/// Whether what jobs find can be stored, as far as is known. Once that failed
/// it tries to write as much, after 1 s, 2 s, ... up to every 30 s, until it
/// can: nobody runs a job for hours to find the disk full again.
///
/// Thread-safe.
class StorageGate {
 public:
  static constexpr absl::Duration kFirstProbe = absl::Seconds(1);
  static constexpr absl::Duration kLongestPause = absl::Seconds(30);

  struct Parts {
    Executor* timers;
    /// Whether this many bytes can be written.
    std::function<absl::Status(std::int64_t bytes)> probe;
    /// Told once why it closed, then OK once it is open again.
    std::function<void(const absl::Status&)> on_change;
  };

  explicit StorageGate(Parts parts) : parts_(std::move(parts)) {}

  bool is_open() const { return is_open_; }

  /// `bytes` could not be stored.
  void Close(std::int64_t bytes, const absl::Status& why);

  /// No more attempts; it stays as it is.
  void Stop();

 private:
  void Probe();
  void ProbeLater();

  const Parts parts_;
  std::atomic<bool> is_open_ = true;
  Mutex mutex_;
  bool is_stopped_ ABSL_GUARDED_BY(mutex_) = false;
  std::int64_t bytes_ ABSL_GUARDED_BY(mutex_) = 0;
  absl::Duration pause_ ABSL_GUARDED_BY(mutex_) = kFirstProbe;
  Executor::Timer timer_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace isomatch
