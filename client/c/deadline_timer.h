#pragma once

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <stop_token>
#include <thread>

namespace isomatch {

/// Requests a stop when so much time has gone, unless it is destroyed before.
class DeadlineTimer {
 public:
  explicit DeadlineTimer(std::chrono::nanoseconds after)
      : thread_([this, after](const std::stop_token& end) {
          std::unique_lock lock(mutex_);
          if (!ended_.wait_for(lock, end, after, [] { return false; }) &&
              !end.stop_requested()) {
            passed_.request_stop();
          }
        }) {}
  DeadlineTimer(const DeadlineTimer&) = delete;
  DeadlineTimer& operator=(const DeadlineTimer&) = delete;

  std::stop_token passed() const { return passed_.get_token(); }

 private:
  std::stop_source passed_;
  std::mutex mutex_;
  std::condition_variable_any ended_;
  std::jthread thread_;  ///< the last member: it uses the others
};

}  // namespace isomatch
