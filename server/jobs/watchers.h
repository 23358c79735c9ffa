#pragma once

#include <functional>
#include <memory>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "core/base/mutex.h"

namespace isomatch {

/// Someone who wants to know that a job changed.
class JobWatcher {
 public:
  virtual ~JobWatcher() = default;

  /// Called after each change, without a lock, from any thread, several at a
  /// time. Must be quick; it reads the new state itself.
  virtual void OnJobChanged() = 0;
};

/// Who watches which job. Holds no watcher alive. Thread-safe.
class Watchers {
 public:
  /// `on_unwatched` is called, without a lock, when a job has lost its last
  /// watcher; another may have come since. May be empty.
  explicit Watchers(
      std::function<void(const std::string& id)> on_unwatched = {})
      : on_unwatched_(std::move(on_unwatched)) {}

  void Add(const std::string& id, const std::shared_ptr<JobWatcher>& watcher);
  void Remove(const std::string& id, const JobWatcher* watcher);

  /// Calls OnJobChanged of all watchers of the job.
  void Notify(const std::string& id);

  /// Calls OnJobChanged of all watchers.
  void NotifyAll();

  /// Returns how many watchers there are, of all jobs.
  int size() const;

  /// Returns the jobs that somebody watches.
  std::vector<std::string> Ids() const;

  /// True while somebody watches the job.
  bool IsWatched(const std::string& id) const;

 private:
  struct Entry {
    const JobWatcher* address;
    std::weak_ptr<JobWatcher> watcher;
  };

  std::vector<std::shared_ptr<JobWatcher>> Of(const std::string& id);

  const std::function<void(const std::string& id)> on_unwatched_;
  mutable Mutex mutex_;
  std::unordered_map<std::string, std::vector<Entry>> watchers_
      ABSL_GUARDED_BY(mutex_);
};

}  // namespace isomatch
