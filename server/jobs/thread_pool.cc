#include "server/jobs/thread_pool.h"

#include <cassert>
#include <chrono>
#include <new>
#include <utility>

#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/thread_pool.hpp>

namespace isomatch {
namespace {

using boost::asio::steady_timer;

/// When a timer's task is tried again.
constexpr std::chrono::milliseconds kAgain(100);

void Wait(const std::shared_ptr<steady_timer>& timer,
          std::function<void()> task) {
  timer->async_wait([weak = std::weak_ptr(timer),
                     task = std::move(task)](boost::system::error_code error) {
    if (error) return;
    try {
      task();
    } catch (const std::bad_alloc&) {
      const auto again = weak.lock();
      if (again == nullptr) return;
      again->expires_after(kAgain);
      Wait(again, task);
    }
  });
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
  Wait(timer, std::move(task));
  return timer;
}

}  // namespace isomatch
