#include "server/jobs/storage_gate.h"

#include <algorithm>
#include <utility>

namespace isomatch {

bool StorageGate::Check() {
  if (!is_open_) return false;
  const absl::Status probed = environment_.probe();
  if (!probed.ok()) Close(probed);
  return is_open_;
}

void StorageGate::Close(const absl::Status& why) {
  {
    MutexLock lock(mutex_);
    if (is_stopped_ || timer_ != nullptr) return;
    pause_ = kFirstProbe;
    ProbeLater();  // before it is closed, if memory ends
    is_open_ = false;
  }
  environment_.on_change(why);
}

void StorageGate::ProbeLater() {
  const absl::Duration pause = pause_;
  pause_ = std::min(2 * pause_, environment_.longest_pause);
  timer_ = environment_.timers->PostAfter(pause, [this] { OnTimer(); });
}

void StorageGate::OnTimer() {
  Executor::Timer old;  // dropped after the lock
  {
    MutexLock lock(mutex_);
    if (is_stopped_ || is_open_) return;
    old = timer_;
    ProbeLater();  // first: the probe may be lost
  }
  environment_.on_disk([this] { Probe(); });
}

void StorageGate::Probe() {
  if (is_open_ || !environment_.probe().ok()) return;
  Executor::Timer dropped;  // after the lock
  {
    MutexLock lock(mutex_);
    if (is_open_) return;
    dropped = std::move(timer_);
    is_open_ = true;
  }
  environment_.on_change(absl::OkStatus());
}

void StorageGate::Stop() {
  Executor::Timer dropped;  // after the lock
  MutexLock lock(mutex_);
  is_stopped_ = true;
  dropped = std::move(timer_);
}

}  // namespace isomatch
