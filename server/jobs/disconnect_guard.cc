#include "server/jobs/disconnect_guard.h"

namespace isomatch {

void DisconnectGuard::Guard(const std::string& id) {
  {
    MutexLock lock(mutex_);
    entries_[id];
  }
  BeginPeriod(id);
}

void DisconnectGuard::OnUnwatched(const std::string& id) { BeginPeriod(id); }

void DisconnectGuard::Release(const std::string& id) {
  Entries::node_type released;  // freed after the lock
  MutexLock lock(mutex_);
  released = entries_.extract(id);
}

void DisconnectGuard::ReleaseAll() {
  Entries released;
  MutexLock lock(mutex_);
  released.swap(entries_);
}

void DisconnectGuard::BeginPeriod(const std::string& id) {
  std::uint64_t period = 0;
  {
    MutexLock lock(mutex_);
    const auto found = entries_.find(id);
    if (found == entries_.end()) return;
    period = found->second.period = ++last_period_;
  }
  Executor::Timer timer = timers_->PostAfter(
      grace_, [this, id, period] { OnPeriodOver(id, period); });
  MutexLock lock(mutex_);
  if (Entry* const entry = Find(id, period)) entry->timer.swap(timer);
}

void DisconnectGuard::OnPeriodOver(const std::string& id,
                                   std::uint64_t period) {
  if (watchers_->IsWatched(id)) return;
  Entries::node_type released;  // freed after the lock
  {
    MutexLock lock(mutex_);
    // Somebody may have watched it for a moment: then a newer period counts.
    if (Find(id, period) == nullptr) return;
    released = entries_.extract(id);
  }
  cancel_(id);
}

DisconnectGuard::Entry* DisconnectGuard::Find(const std::string& id,
                                              std::uint64_t period) {
  const auto found = entries_.find(id);
  return found != entries_.end() && found->second.period == period
             ? &found->second
             : nullptr;
}

}  // namespace isomatch
