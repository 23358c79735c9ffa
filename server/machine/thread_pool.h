#pragma once

#include <memory>

#include "server/machine/executor.h"

namespace isomatch {

/// An Executor on a boost::asio::io_context. (Not boost::asio::thread_pool: one
/// of a single thread cannot have a second. Not a oneTBB arena: its worker
/// threads are shared by the whole process and bounded by its cores, so that a
/// long job would keep other arenas' tasks waiting. Match brings its own arena;
/// the pool's thread is that arena's first.)
class ThreadPool : public Executor {
 public:
  /// REQUIRES: threads > 0.
  explicit ThreadPool(int threads);

  /// Waits for all tasks. REQUIRES: no Timer is left.
  ~ThreadPool() override;

  void Post(std::function<void()> task) override;
  bool AddThread() override;
  [[nodiscard]] Timer PostAfter(absl::Duration delay,
                                std::function<void()> task) override;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace isomatch
