#include "server/jobs/thread_pool.h"

#include <cassert>
#include <utility>

#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/thread_pool.hpp>

namespace isomatch {

struct ThreadPool::Impl {
  explicit Impl(int threads) : pool(static_cast<size_t>(threads)) {}
  boost::asio::thread_pool pool;
};

ThreadPool::ThreadPool(int threads) : impl_(std::make_unique<Impl>(threads)) {
  assert(threads > 0);
}

ThreadPool::~ThreadPool() { impl_->pool.join(); }

void ThreadPool::Post(std::function<void()> task) {
  boost::asio::post(impl_->pool, std::move(task));
}

Executor::Timer ThreadPool::PostAfter(absl::Duration delay,
                                      std::function<void()> task) {
  auto timer = std::make_shared<boost::asio::steady_timer>(
      impl_->pool, absl::ToChronoNanoseconds(delay));
  timer->async_wait([task = std::move(task)](boost::system::error_code error) {
    if (!error) task();
  });
  return timer;
}

}  // namespace isomatch
