#include "server/jobs/tenant_turns.h"

#include <atomic>
#include <functional>
#include <latch>
#include <memory>
#include <new>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/time/clock.h"
#include "core/base/mutex.h"
#include "server/jobs/errors.h"
#include "server/machine/thread_pool.h"
#include "tests/server/manual_executor.h"
#include "tests/support/matchers.h"

namespace isomatch {
namespace {

/// Two threads; of a tenant one task runs and four wait.
class TenantTurnsTest : public testing::Test {
 protected:
  bool Post(const std::string& tenant) {
    return turns_.Post(tenant, [this, tenant] { Record(tenant); }).ok();
  }

  /// Posts a task that runs until the notification.
  void Block(const std::string& tenant, std::latch& until) {
    std::latch started(1);
    ASSERT_THAT(turns_.Post(tenant,
                            [&] {
                              started.count_down();
                              until.wait();
                            }),
                IsOk());
    started.wait();
  }

  void Record(const std::string& tenant) {
    MutexLock lock(mutex_);
    order_.push_back(tenant);
  }

  size_t CountRecorded() {
    MutexLock lock(mutex_);
    return order_.size();
  }

  std::string Order() {
    pool_.reset();  // waits for all
    MutexLock lock(mutex_);
    std::string order;
    for (const std::string& tenant : order_) order += tenant;
    return order;
  }

  std::unique_ptr<ThreadPool> pool_ = std::make_unique<ThreadPool>(2);
  TenantTurns turns_{{.max_running_per_tenant = 1, .max_waiting_per_tenant = 4},
                     pool_.get()};
  Mutex mutex_;
  std::vector<std::string> order_ ABSL_GUARDED_BY(mutex_);
};

TEST_F(TenantTurnsTest, ASlowTenantDelaysNobodyElse) {
  std::latch end(1);
  Block("a", end);
  for (int i = 0; i < 4; ++i) EXPECT_TRUE(Post("a"));
  std::latch done(1);
  ASSERT_THAT(turns_.Post("b", [&] { done.count_down(); }), IsOk());
  done.wait();  // though the task of a goes on
  {
    MutexLock lock(mutex_);
    EXPECT_TRUE(order_.empty());  // one of a tenant at a time
  }
  end.count_down();
  EXPECT_EQ(Order(), "aaaa");
}

TEST_F(TenantTurnsTest, TenantsTakeTurns) {
  std::latch end_x(1);
  std::latch end_y(1);
  Block("x", end_x);
  Block("y", end_y);
  for (int i = 0; i < 4; ++i) Post("a");
  for (int i = 0; i < 2; ++i) Post("b");
  Post("c");
  end_y.count_down();  // one thread has them all
  while (CountRecorded() < 7) absl::SleepFor(absl::Milliseconds(1));
  end_x.count_down();
  EXPECT_EQ(Order(), "abcabaa");
}

TEST_F(TenantTurnsTest, TooManyThatWaitAreRefused) {
  std::latch end(1);
  Block("a", end);
  for (int i = 0; i < 4; ++i) EXPECT_TRUE(Post("a"));
  const absl::Status refused = turns_.Post("a", [this] { Record("never"); });
  EXPECT_TRUE(absl::IsResourceExhausted(refused));
  EXPECT_EQ(DetailsOf(refused).reason, "TENANT_QUOTA");
  EXPECT_TRUE(DetailsOf(refused).retry_after);
  EXPECT_TRUE(Post("b"));
  end.count_down();
  EXPECT_EQ(Order().size(), 5);
}

TEST_F(TenantTurnsTest, ATaskWithoutMemoryIsOverAndTheNextOnesRun) {
  std::latch end(1);
  Block("a", end);
  ASSERT_THAT(turns_.Post("a", [] { throw std::bad_alloc(); }), IsOk());
  EXPECT_TRUE(Post("a"));
  end.count_down();
  EXPECT_EQ(Order(), "a");
}

/// Has no memory to take a task when the test says so.
class FullExecutor : public ManualExecutor {
 public:
  void Post(std::function<void()> task) override {
    if (before_post) before_post();
    ManualExecutor::Post(std::move(task));
  }
  std::function<void()> before_post;
};

TEST(TenantTurnsMemoryTest, ATaskThatIsRefusedNeverRuns) {
  FullExecutor executor;
  TenantTurns turns({.max_waiting_per_tenant = 4}, &executor);
  std::string ran;
  executor.before_post = [] { throw std::bad_alloc(); };
  EXPECT_THROW((void)turns.Post("a", [&] { ran += "refused"; }),
               std::bad_alloc);
  executor.before_post = nullptr;
  EXPECT_THAT(turns.Post("a", [&] { ran += "taken"; }), IsOk());
  while (executor.RunNext()) {
  }
  EXPECT_EQ(ran, "taken");
}

TEST(TenantTurnsMemoryTest, ATaskThatRanMeanwhileIsNotRefused) {
  FullExecutor executor;
  TenantTurns turns({.max_waiting_per_tenant = 4}, &executor);
  std::string ran;
  EXPECT_THAT(turns.Post("a", [&] { ran += "1"; }), IsOk());
  executor.before_post = [&] {
    executor.RunNext();
    throw std::bad_alloc();
  };
  EXPECT_THAT(turns.Post("a", [&] { ran += "2"; }), IsOk());
  EXPECT_EQ(ran, "12");
}

// Else what keeps it busy for an hour would fill its queue with them.
TEST(TenantTurnsMemoryTest,
     TasksThatComeWhileOthersRunTakeNothingOfTheExecutor) {
  ManualExecutor executor;
  TenantTurns turns({.max_waiting_per_tenant = 4}, &executor);
  int left = 1000;
  std::function<void()> follow = [&] {
    if (--left == 0) return;
    EXPECT_THAT(turns.Post("a", follow), IsOk());
  };
  ASSERT_THAT(turns.Post("a", follow), IsOk());
  int runs = 0;
  while (executor.RunNext()) ++runs;
  EXPECT_EQ(left, 0);
  EXPECT_LE(runs, 100);
}

TEST_F(TenantTurnsTest, NoTaskIsLostHoweverTheyCome) {
  constexpr int kTasks = 5000;
  std::atomic<int> ran = 0;
  for (int i = 0; i < kTasks; ++i) {
    const std::string tenant(1, static_cast<char>('a' + i % 3));
    while (!turns_.Post(tenant, [&ran] { ++ran; }).ok()) {
    }
  }
  Order();
  EXPECT_EQ(ran, kTasks);
}

}  // namespace
}  // namespace isomatch
