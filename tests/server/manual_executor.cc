#include "tests/server/manual_executor.h"

#include <algorithm>
#include <utility>

namespace isomatch {

Executor::Timer ManualExecutor::PostAfter(absl::Duration delay,
                                          std::function<void()> task) {
  auto timer = std::make_shared<int>(0);
  timers_.push_back({now_ + delay, timer, std::move(task)});
  return timer;
}

bool ManualExecutor::RunNext() {
  if (tasks_.empty()) return false;
  const std::function<void()> task = std::move(tasks_.front());
  tasks_.pop_front();
  task();
  return true;
}

void ManualExecutor::Advance(absl::Duration duration) {
  now_ += duration;
  std::vector<Scheduled> due;
  std::erase_if(timers_, [&](const Scheduled& timer) {
    if (timer.due > now_) return false;
    due.push_back(timer);
    return true;
  });
  for (const Scheduled& timer : due) {
    if (!timer.wanted.expired()) timer.task();
  }
}

int ManualExecutor::live_timers() const {
  return static_cast<int>(
      std::count_if(timers_.begin(), timers_.end(),
                    [](const auto& timer) { return !timer.wanted.expired(); }));
}

}  // namespace isomatch
