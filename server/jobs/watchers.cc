#include "server/jobs/watchers.h"

namespace isomatch {

void Watchers::Add(const std::string& id,
                   const std::shared_ptr<JobWatcher>& watcher) {
  MutexLock lock(mutex_);
  watchers_[id].push_back({watcher.get(), watcher});
}

void Watchers::Remove(const std::string& id, const JobWatcher* watcher) {
  {
    MutexLock lock(mutex_);
    const auto found = watchers_.find(id);
    if (found == watchers_.end()) return;
    std::erase_if(found->second,
                  [&](const Entry& entry) { return entry.address == watcher; });
    if (!found->second.empty()) return;
    watchers_.erase(found);
  }
  if (on_unwatched_) on_unwatched_(id);
}

bool Watchers::IsWatched(const std::string& id) const {
  MutexLock lock(mutex_);
  return watchers_.count(id) != 0;
}

void Watchers::Notify(const std::string& id) {
  for (const auto& watcher : Of(id)) watcher->OnJobChanged();
}

void Watchers::NotifyAll() {
  std::vector<std::shared_ptr<JobWatcher>> alive;
  {
    MutexLock lock(mutex_);
    for (const auto& [id, entries] : watchers_) {
      for (const Entry& entry : entries) {
        if (auto watcher = entry.watcher.lock()) alive.push_back(watcher);
      }
    }
  }
  for (const auto& watcher : alive) watcher->OnJobChanged();
}

int Watchers::size() const {
  size_t count = 0;
  MutexLock lock(mutex_);
  for (const auto& [id, entries] : watchers_) count += entries.size();
  return static_cast<int>(count);
}

std::vector<std::string> Watchers::Ids() const {
  std::vector<std::string> ids;
  MutexLock lock(mutex_);
  for (const auto& [id, entries] : watchers_) ids.push_back(id);
  return ids;
}

std::vector<std::shared_ptr<JobWatcher>> Watchers::Of(const std::string& id) {
  std::vector<std::shared_ptr<JobWatcher>> alive;
  MutexLock lock(mutex_);
  const auto found = watchers_.find(id);
  if (found == watchers_.end()) return alive;
  for (const Entry& entry : found->second) {
    if (auto watcher = entry.watcher.lock()) alive.push_back(watcher);
  }
  return alive;
}

}  // namespace isomatch
