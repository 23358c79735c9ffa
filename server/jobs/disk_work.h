#pragma once

#include <functional>
#include <utility>

#include "core/base/mutex.h"
#include "server/machine/executor.h"

namespace isomatch {

/// Runs what waits for the disk, so that nothing else waits for it.
/// Thread-safe.
class DiskWork {
 public:
  /// Null: work is done on the thread that asks for it.
  explicit DiskWork(Executor* disk) : disk_(disk) {}

  /// Runs `work` soon; not at all on the executor after Stop.
  void Run(std::function<void()> work) {
    if (disk_ == nullptr) return work();
    MutexLock lock(mutex_);
    if (!is_stopped_) disk_->Post(std::move(work));
  }

  /// The executor is asked nothing from now on.
  void Stop() {
    MutexLock lock(mutex_);
    is_stopped_ = true;
  }

 private:
  Executor* const disk_;
  Mutex mutex_;
  bool is_stopped_ ABSL_GUARDED_BY(mutex_) = false;
};

}  // namespace isomatch
