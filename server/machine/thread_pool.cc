#include "server/machine/thread_pool.h"

#include <cassert>
#include <chrono>
#include <new>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include <boost/asio/executor_work_guard.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>

#include "core/base/mutex.h"

namespace isomatch {
namespace {

using boost::asio::steady_timer;

/// When a timer's task is tried again.
constexpr std::chrono::milliseconds kAgain(100);

using Task = std::shared_ptr<const std::function<void()>>;

void WaitAgain(const std::weak_ptr<steady_timer>& weak, const Task& task);

void Wait(const std::shared_ptr<steady_timer>& timer, const Task& task) {
  timer->async_wait(
      [weak = std::weak_ptr(timer), task](boost::system::error_code error) {
        if (error) return;
        try {
          (*task)();
        } catch (const std::bad_alloc&) {
          WaitAgain(weak, task);
        }
      });
}

/// Sets the timer anew; does nothing when nobody holds it any more.
void WaitAgain(const std::weak_ptr<steady_timer>& weak, const Task& task) {
  while (const auto timer = weak.lock()) {
    try {
      timer->expires_after(kAgain);
      return Wait(timer, task);
    } catch (const std::bad_alloc&) {  // not even for that
      std::this_thread::sleep_for(kAgain);
    }
  }
}

}  // namespace

struct ThreadPool::Impl {
  using Work =
      boost::asio::executor_work_guard<boost::asio::io_context::executor_type>;

  void Start() {
    MutexLock lock(mutex);
    threads.emplace_back([this] { context.run(); });
  }

  boost::asio::io_context context;
  Work work{context.get_executor()};
  Mutex mutex;
  std::vector<std::thread> threads ABSL_GUARDED_BY(mutex);
};

ThreadPool::ThreadPool(int threads) : impl_(std::make_unique<Impl>()) {
  assert(threads > 0);
  for (int i = 0; i < threads; ++i) impl_->Start();
}

ThreadPool::~ThreadPool() {
  impl_->work.reset();
  std::vector<std::thread> threads;
  {
    MutexLock lock(impl_->mutex);
    threads.swap(impl_->threads);
  }
  for (std::thread& thread : threads) thread.join();
}

bool ThreadPool::AddThread() {
  try {
    impl_->Start();
    return true;
  } catch (const std::system_error&) {  // as many as the system allows
    return false;
  } catch (const std::bad_alloc&) {
    return false;
  }
}

void ThreadPool::Post(std::function<void()> task) {
  boost::asio::post(impl_->context, [task = std::move(task)] {
    try {
      task();
    } catch (const std::bad_alloc&) {  // this task is lost; the others are not
    }
  });
}

Executor::Timer ThreadPool::PostAfter(absl::Duration delay,
                                      std::function<void()> task) {
  auto timer = std::make_shared<steady_timer>(impl_->context,
                                              absl::ToChronoNanoseconds(delay));
  Wait(timer, std::make_shared<const std::function<void()>>(std::move(task)));
  return timer;
}

}  // namespace isomatch
