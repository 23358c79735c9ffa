#pragma once

#include <cstddef>
#include <deque>
#include <functional>
#include <memory>
#include <utility>
#include <vector>

#include "server/machine/executor.h"

namespace isomatch {

/// An executor whose tasks run when the test says so, on the test's thread.
class ManualExecutor : public Executor {
 public:
  void Post(std::function<void()> task) override {
    tasks_.push_back(std::move(task));
  }
  Timer PostAfter(absl::Duration delay, std::function<void()> task) override;

  /// Runs the first posted task; false when there is none.
  bool RunNext();

  /// Forgets all tasks and timers.
  void Clear() {
    tasks_.clear();
    timers_.clear();
  }

  /// Lets time pass: runs the timers that are due and still wanted.
  void Advance(absl::Duration duration);

  /// Timers that were not dropped and have not run.
  int live_timers() const;

 private:
  struct Scheduled {
    absl::Duration due;
    std::weak_ptr<void> wanted;
    std::function<void()> task;
  };
  std::deque<std::function<void()>> tasks_;
  std::vector<Scheduled> timers_;
  absl::Duration now_;
};

/// Timers that cannot be called off, as those whose function has begun.
class BegunTimers : public Executor {
 public:
  void Post(std::function<void()>) override {}
  Timer PostAfter(absl::Duration, std::function<void()> task) override {
    tasks_.push_back(std::move(task));
    return std::make_shared<int>(0);
  }

  /// Runs the function of the i-th timer, counted from 0.
  void Run(int i) { tasks_[static_cast<std::size_t>(i)](); }

 private:
  std::vector<std::function<void()>> tasks_;
};

}  // namespace isomatch
