// What parallel.h promises, in std::threads instead of oneTBB: slower, and only
// for ThreadSanitizer. oneTBB as Debian builds it is not instrumented, so its
// handing over of a task is not seen, and what hides those reports hides races
// inside the tasks too.

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <exception>
#include <memory>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

#include "core/base/parallel.h"

namespace isomatch {
namespace {

int DefaultThreads() {
  return std::max(2, static_cast<int>(std::thread::hardware_concurrency()));
}

// How many threads the calling one may use, itself included.
thread_local int allowed_threads = DefaultThreads();

/// A thread that runs one function after the other.
class IdleThread {
 public:
  IdleThread() : thread_([this] { Loop(); }) {}
  ~IdleThread() { Start(nullptr); }

  /// REQUIRES: what was started before was waited for. Null ends the thread.
  void Start(std::function<void()> body) {
    const std::lock_guard lock(mutex_);
    body_ = std::move(body);
    is_busy_ = true;
    changed_.notify_all();
  }

  void Wait() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return !is_busy_; });
  }

 private:
  void Loop() {
    std::unique_lock lock(mutex_);
    while (true) {
      changed_.wait(lock, [&] { return is_busy_; });
      if (!body_) return;
      lock.unlock();
      body_();
      lock.lock();
      is_busy_ = false;
      changed_.notify_all();
    }
  }

  std::mutex mutex_;
  std::condition_variable changed_;
  std::function<void()> body_;
  bool is_busy_ = false;
  std::jthread thread_;  // last, since it uses the others
};

/// Threads that nobody uses: starting one takes long under ThreadSanitizer.
class IdleThreads {
 public:
  std::unique_ptr<IdleThread> Take() {
    const std::lock_guard lock(mutex_);
    if (idle_.empty()) return std::make_unique<IdleThread>();
    std::unique_ptr<IdleThread> thread = std::move(idle_.back());
    idle_.pop_back();
    return thread;
  }

  void GiveBack(std::unique_ptr<IdleThread> thread) {
    const std::lock_guard lock(mutex_);
    idle_.push_back(std::move(thread));
  }

  static IdleThreads& Instance() {
    static IdleThreads threads;
    return threads;
  }

 private:
  std::mutex mutex_;
  std::vector<std::unique_ptr<IdleThread>> idle_;
};

/// Runs `body` on another thread, which may use `allowed` threads. What `body`
/// throws comes out of Join, which has to be called.
class Task {
 public:
  Task(int allowed, const std::function<void()>& body)
      : thread_(IdleThreads::Instance().Take()) {
    thread_->Start([this, allowed, &body] {
      allowed_threads = allowed;
      try {
        body();
      } catch (...) {
        thrown_ = std::current_exception();
      }
    });
  }

  void Join() {
    thread_->Wait();
    IdleThreads::Instance().GiveBack(std::move(thread_));
    if (thrown_) std::rethrow_exception(thrown_);
  }

 private:
  std::exception_ptr thrown_;
  std::unique_ptr<IdleThread> thread_;
};

/// Runs all of `bodies` at the same time, each with `allowed` threads, and
/// throws what the first of them threw.
void RunAll(int allowed, const std::vector<std::function<void()>>& bodies) {
  std::vector<std::unique_ptr<Task>> tasks;
  tasks.reserve(bodies.size());
  for (const auto& body : bodies) {
    tasks.push_back(std::make_unique<Task>(allowed, body));
  }
  std::exception_ptr thrown;
  for (const auto& task : tasks) {
    try {
      task->Join();
    } catch (...) {
      if (!thrown) thrown = std::current_exception();
    }
  }
  if (thrown) std::rethrow_exception(thrown);
}

}  // namespace

absl::Status ParallelFor(std::int64_t count, const std::stop_token& stop,
                         const std::function<void(std::int64_t)>& body) {
  std::atomic<std::int64_t> next = 0;
  const auto run = [&] {
    while (!stop.stop_requested()) {
      // Relaxed: two bodies that share what they write must be reported.
      const std::int64_t i = next.fetch_add(1, std::memory_order_relaxed);
      if (i >= count) return;
      body(i);
    }
  };
  const auto threads = std::min<std::int64_t>(allowed_threads, count);
  if (threads <= 1) {
    run();
  } else {
    RunAll(1, std::vector<std::function<void()>>(
                  static_cast<std::size_t>(threads), run));
  }
  return CheckNotCancelled(stop);
}

absl::Status RunBoth(const std::function<absl::Status()>& first,
                     const std::function<absl::Status()>& second) {
  absl::Status status_first;
  absl::Status status_second;
  const std::vector<std::function<void()>> both = {
      [&] { status_first = first(); }, [&] { status_second = second(); }};
  if (allowed_threads <= 1) {
    for (const auto& run : both) run();
  } else {
    RunAll((allowed_threads + 1) / 2, both);
  }
  return status_first.ok() ? status_second : status_first;
}

void RunWithThreads(int threads, const std::function<void()>& body) {
  RunAll(threads > 0 ? threads : DefaultThreads(), {body});
}

}  // namespace isomatch
