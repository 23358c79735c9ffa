#include "server/jobs/storage_gate.h"

#include <algorithm>
#include <utility>

namespace isomatch {

void StorageGate::Close(std::int64_t bytes, const absl::Status& why) {
  {
    MutexLock lock(mutex_);
    bytes_ = std::max(bytes_, bytes);
    if (!is_open_ || is_stopped_) return;
    is_open_ = false;
    pause_ = kFirstProbe;
  }
  parts_.on_change(why);
  ProbeLater();
}

void StorageGate::ProbeLater() {
  absl::Duration pause;
  {
    MutexLock lock(mutex_);
    pause = std::exchange(pause_, std::min(2 * pause_, kLongestPause));
  }
  Executor::Timer next = parts_.timers->PostAfter(pause, [this] { Probe(); });
  MutexLock lock(mutex_);
  if (!is_stopped_)
    std::swap(timer_, next);  // the old one drops after the lock
}

void StorageGate::Probe() {
  std::int64_t bytes = 0;
  {
    MutexLock lock(mutex_);
    if (is_stopped_) return;
    bytes = bytes_;
  }
  if (!parts_.probe(bytes).ok()) return ProbeLater();
  {
    MutexLock lock(mutex_);
    bytes_ = 0;
    is_open_ = true;
  }
  parts_.on_change(absl::OkStatus());
}

void StorageGate::Stop() {
  Executor::Timer dropped;  // after the lock
  MutexLock lock(mutex_);
  is_stopped_ = true;
  dropped = std::move(timer_);
}

}  // namespace isomatch
