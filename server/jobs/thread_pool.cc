#include "server/jobs/thread_pool.h"

#include <cassert>
#include <chrono>
#include <new>
#include <thread>
#include <utility>

#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/thread_pool.hpp>

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

/// Unless nobody holds the timer any more.
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
  explicit Impl(int threads) : pool(static_cast<size_t>(threads)) {}
  boost::asio::thread_pool pool;
};

ThreadPool::ThreadPool(int threads) : impl_(std::make_unique<Impl>(threads)) {
  assert(threads > 0);
}

ThreadPool::~ThreadPool() { impl_->pool.join(); }

void ThreadPool::Post(std::function<void()> task) {
  boost::asio::post(impl_->pool, [task = std::move(task)] {
    try {
      task();
    } catch (const std::bad_alloc&) {  // this task is lost; the others are not
    }
  });
}

Executor::Timer ThreadPool::PostAfter(absl::Duration delay,
                                      std::function<void()> task) {
  auto timer = std::make_shared<steady_timer>(impl_->pool,
                                              absl::ToChronoNanoseconds(delay));
  Wait(timer, std::make_shared<const std::function<void()>>(std::move(task)));
  return timer;
}

}  // namespace isomatch
