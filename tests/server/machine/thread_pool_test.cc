#include "server/machine/thread_pool.h"

#include <pthread.h>

#include <atomic>
#include <cstddef>
#include <latch>
#include <memory>
#include <new>

#include <gtest/gtest.h>

#include "absl/time/clock.h"

namespace isomatch {
namespace {

TEST(ThreadPoolTest, RunsAsManyTasksAtATimeAsItHasThreads) {
  ThreadPool pool(3);
  std::latch together(3);  // opens only when all three run at once
  for (int i = 0; i < 3; ++i) pool.Post([&] { together.arrive_and_wait(); });
  together.wait();
}

TEST(ThreadPoolTest, AnAddedThreadTakesThePlaceOfOneThatDoesNotComeBack) {
  ThreadPool pool(1);
  std::latch stuck(1);
  std::latch ran(1);
  pool.Post([&] { stuck.wait(); });
  pool.Post([&] { ran.count_down(); });
  EXPECT_TRUE(pool.AddThread());
  ran.wait();
  stuck.count_down();
}

TEST(ThreadPoolTest, SaysWhenTheSystemHasNoThreadMore) {
  ThreadPool pool(1);
  pthread_attr_t usual;
  ASSERT_EQ(pthread_getattr_default_np(&usual), 0);
  pthread_attr_t huge;
  ASSERT_EQ(pthread_attr_init(&huge), 0);
  ASSERT_EQ(pthread_attr_setstacksize(&huge, std::size_t{1} << 47), 0);
  ASSERT_EQ(pthread_setattr_default_np(&huge), 0);  // more than addresses
  EXPECT_FALSE(pool.AddThread());
  EXPECT_EQ(pthread_setattr_default_np(&usual), 0);
  EXPECT_TRUE(pool.AddThread());
}

TEST(ThreadPoolTest, FinishesPostedTasksBeforeItGoes) {
  std::atomic<int> runs = 0;
  {
    ThreadPool pool(1);
    for (int i = 0; i < 100; ++i) pool.Post([&] { ++runs; });
  }
  EXPECT_EQ(runs, 100);
}

TEST(ThreadPoolTest, ATimerRunsAfterItsDelay) {
  ThreadPool pool(1);
  std::latch ran(1);
  const absl::Time begin = absl::Now();
  const auto timer =
      pool.PostAfter(absl::Milliseconds(30), [&] { ran.count_down(); });
  ran.wait();
  EXPECT_GE(absl::Now() - begin, absl::Milliseconds(29));
}

TEST(ThreadPoolTest, ADroppedTimerNeverRunsAndHoldsNothingUp) {
  std::atomic<bool> ran = false;
  const absl::Time begin = absl::Now();
  {
    ThreadPool pool(1);
    auto timer = pool.PostAfter(absl::Seconds(30), [&] { ran = true; });
    timer.reset();
  }
  EXPECT_FALSE(ran);
  EXPECT_LT(absl::Now() - begin, absl::Seconds(10));
}

TEST(ThreadPoolTest, ATaskThatFindsNoMemoryLeavesTheOthersAlone) {
  std::latch ran(1);
  ThreadPool pool(1);
  pool.Post([] { throw std::bad_alloc(); });
  pool.Post([&] { ran.count_down(); });
  ran.wait();
}

TEST(ThreadPoolTest, ATimerThatFindsNoMemoryRunsAgain) {
  std::atomic<int> runs = 0;
  std::latch third(1);
  ThreadPool pool(1);
  const auto timer = pool.PostAfter(absl::ZeroDuration(), [&] {
    if (++runs < 3) throw std::bad_alloc();
    third.count_down();
  });
  third.wait();
  EXPECT_EQ(runs, 3);
}

}  // namespace
}  // namespace isomatch
