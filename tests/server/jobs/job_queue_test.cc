#include "server/jobs/job_queue.h"

#include <limits>
#include <map>
#include <memory>
#include <random>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"

namespace isomatch {
namespace {

constexpr int kNoLimit = std::numeric_limits<int>::max();

/// Its priority counts among tenants too.
std::shared_ptr<LiveJob> NewJob(const std::string& id, std::int64_t bytes,
                                const std::string& tenant = "a",
                                int priority = 0) {
  auto job = std::make_shared<LiveJob>();
  job->id = id;
  job->tenant = tenant;
  job->priority = priority;
  job->shared_priority = priority;
  job->memory_estimate_bytes = bytes;
  return job;
}

std::string IdOf(const std::shared_ptr<LiveJob>& job) {
  return job == nullptr ? "none" : job->id;
}

TEST(JobQueueTest, IsFirstComeFirstServedWhenAllFit) {
  MemoryBudget budget(100);
  JobQueue queue(2, kNoLimit);
  queue.Push(NewJob("a", 10));
  queue.Push(NewJob("b", 10));
  EXPECT_EQ(IdOf(queue.PopFitting(budget)), "a");
  EXPECT_EQ(IdOf(queue.PopFitting(budget)), "b");
  EXPECT_EQ(IdOf(queue.PopFitting(budget)), "none");
}

TEST(JobQueueTest, OneThatIsHeldIsPassedByAll) {
  MemoryBudget budget(100);
  JobQueue queue(0, kNoLimit);
  const auto held = NewJob("held", 10);
  held->is_held = true;
  queue.Push(held);
  for (const char* id : {"a", "b", "c"}) queue.Push(NewJob(id, 10));
  EXPECT_EQ(queue.CountHeld(), 1);
  for (const char* id : {"a", "b", "c", "none"}) {
    EXPECT_EQ(IdOf(queue.PopFitting(budget)), id);
  }
  held->is_held = false;
  EXPECT_EQ(queue.CountHeld(), 0);
  EXPECT_EQ(IdOf(queue.PopFitting(budget)), "held");
}

TEST(JobQueueTest, OneThatIsHeldTakesNoTurnOfItsTenant) {
  MemoryBudget budget(100);
  JobQueue queue(0, kNoLimit);
  const auto held = NewJob("held", 1, "a", /*priority=*/5);
  held->is_held = true;
  queue.Push(held);
  for (const char* id : {"a1", "a2", "a3"}) queue.Push(NewJob(id, 1, "a"));
  for (const char* id : {"b1", "b2", "b3"}) queue.Push(NewJob(id, 1, "b"));
  EXPECT_EQ(queue.JobsAhead("a2"), 2);
  EXPECT_EQ(queue.JobsAhead("held"), 6);
  std::string order;
  for (int i = 0; i < 6; ++i) {
    const auto job = queue.PopFitting(budget);
    ASSERT_NE(job, nullptr);
    order += job->id;
    queue.OnEnded(job->tenant);
    if (i == 3) queue.EndHold(*held);
  }
  EXPECT_EQ(order, "a1b1a2b2heldb3");
  EXPECT_EQ(queue.JobsAhead("a3"), 0);
}

TEST(JobQueueTest, WhatNeedsMoreThanThereIsIsPassedByAll) {
  MemoryBudget budget(100);
  const auto stuck = budget.Reserve(10);
  JobQueue queue(0, kNoLimit);
  queue.Push(NewJob("large", 91));
  for (const char* id : {"a", "b", "c"}) queue.Push(NewJob(id, 1));
  EXPECT_TRUE(queue.HasLargerThan(90));
  EXPECT_FALSE(queue.HasLargerThan(91));
  for (const char* id : {"a", "b", "c", "none"}) {
    EXPECT_EQ(IdOf(queue.PopFitting(budget, 90)), id);
  }
  EXPECT_EQ(IdOf(queue.PopFitting(budget)), "none");
  EXPECT_EQ(queue.Remove("large")->passes, 0);
}

TEST(JobQueueTest, CountsByPriority) {
  JobQueue queue(2, kNoLimit);
  EXPECT_TRUE(queue.CountByPriority().empty());
  queue.Push(NewJob("a", 1, "x", 5));
  queue.Push(NewJob("b", 1, "y", 5));
  queue.Push(NewJob("c", 1, "y", -1));
  using testing::ElementsAre;
  EXPECT_THAT(queue.CountByPriority(),
              ElementsAre(std::pair(-1, 1), std::pair(5, 2)));
  queue.Remove("a");
  EXPECT_EQ(queue.CountByPriority()[5], 1);
}

TEST(JobQueueTest, ASmallJobPassesALargeOneOnlySoManyTimes) {
  MemoryBudget budget(100);
  const auto other = budget.Reserve(50);
  JobQueue queue(/*max_passes=*/2, kNoLimit);
  queue.Push(NewJob("large", 80));
  for (const char* id : {"a", "b", "c"}) queue.Push(NewJob(id, 1));
  EXPECT_EQ(IdOf(queue.PopFitting(budget)), "a");
  EXPECT_EQ(IdOf(queue.PopFitting(budget)), "b");
  EXPECT_EQ(IdOf(queue.PopFitting(budget)), "none");  // though c would fit
  EXPECT_EQ(queue.JobsAhead("c"), 1);
}

TEST(JobQueueTest, APoppedJobHoldsItsReservation) {
  MemoryBudget budget(100);
  JobQueue queue(2, kNoLimit);
  queue.Push(NewJob("a", 70));
  const auto job = queue.PopFitting(budget);
  EXPECT_EQ(budget.reserved_bytes(), 70);
  job->Release();
  EXPECT_EQ(budget.reserved_bytes(), 0);
}

TEST(JobQueueTest, IsLeftByAnyDoor) {
  MemoryBudget budget(100);
  JobQueue queue(2, kNoLimit);
  for (const char* id : {"a", "b", "c"}) queue.Push(NewJob(id, 1));
  EXPECT_EQ(IdOf(queue.Remove("b")), "b");
  EXPECT_EQ(IdOf(queue.Remove("b")), "none");
  EXPECT_EQ(queue.size(), 2);
  EXPECT_EQ(queue.CountOf("a"), 2);
  EXPECT_EQ(IdOf(queue.PopFitting(budget)), "a");
  EXPECT_EQ(IdOf(queue.PopAny()), "c");
  EXPECT_EQ(IdOf(queue.PopAny()), "none");
  EXPECT_EQ(queue.size(), 0);
  EXPECT_EQ(queue.CountOf("a"), 0);
}

/// The order in which all jobs leave when each ends at once.
std::vector<std::string> Order(JobQueue& queue, MemoryBudget& budget) {
  std::vector<std::string> order;
  while (const auto job = queue.PopFitting(budget)) {
    order.push_back(job->id);
    job->Release();
    queue.OnEnded(job->tenant);
  }
  return order;
}

TEST(JobQueueTest, AHigherPriorityGoesFirst) {
  MemoryBudget budget(100);
  JobQueue queue(2, kNoLimit);
  queue.Push(NewJob("low", 1, "a", -5));
  queue.Push(NewJob("usual", 1, "a", 0));
  queue.Push(NewJob("high", 1, "b", 7));
  queue.Push(NewJob("high too", 1, "a", 7));
  EXPECT_EQ(queue.JobsAhead("low"), 3);
  EXPECT_EQ(queue.JobsAhead("high too"), 1);
  EXPECT_THAT(Order(queue, budget),
              testing::ElementsAre("high", "high too", "usual", "low"));
}

void PushMany(JobQueue& queue, const std::string& tenant, int count,
              int priority = 0) {
  for (int i = 1; i <= count; ++i) {
    queue.Push(NewJob(absl::StrCat(tenant, i), 1, tenant, priority));
  }
}

TEST(JobQueueTest, TenantsTakeTurnsOnOneWorkerToo) {
  MemoryBudget budget(100);
  JobQueue queue(2, kNoLimit);
  PushMany(queue, "a", 4);
  PushMany(queue, "b", 2);
  PushMany(queue, "c", 1);
  EXPECT_EQ(queue.JobsAhead("c1"), 2);
  EXPECT_EQ(queue.JobsAhead("a2"), 3);
  EXPECT_THAT(Order(queue, budget),
              testing::ElementsAre("a1", "b1", "c1", "a2", "b2", "a3", "a4"));
}

TEST(JobQueueTest, TenantsTakeTurnsWhileNoneEnds) {
  MemoryBudget budget(100);
  JobQueue queue(2, kNoLimit);
  PushMany(queue, "a", 4);
  PushMany(queue, "b", 2);
  PushMany(queue, "c", 1);
  std::vector<std::string> order;
  while (const auto job = queue.PopFitting(budget)) order.push_back(job->id);
  EXPECT_THAT(order,
              testing::ElementsAre("a1", "b1", "c1", "a2", "b2", "a3", "a4"));
}

TEST(JobQueueTest, WhoComesLateGetsItsTurnNextAndNoMore) {
  MemoryBudget budget(100);
  JobQueue queue(2, kNoLimit);
  PushMany(queue, "a", 40);
  auto running = queue.PopFitting(budget);
  for (int i = 0; i < 9; ++i) {
    queue.OnEnded("a");
    running = queue.PopFitting(budget);
  }
  PushMany(queue, "b", 3);
  EXPECT_EQ(queue.JobsAhead("b1"), 0);
  EXPECT_EQ(queue.JobsAhead("b2"), 2);
  queue.OnEnded("a");
  const std::vector<std::string> order = Order(queue, budget);
  EXPECT_THAT(
      std::vector(order.begin(), order.begin() + 7),
      testing::ElementsAre("b1", "a11", "b2", "a12", "b3", "a13", "a14"));
}

TEST(JobQueueTest, WhoSendsOneAfterTheOtherHasNoAdvantage) {
  MemoryBudget budget(100);
  JobQueue queue(2, kNoLimit);
  PushMany(queue, "a", 10);
  PushMany(queue, "c", 10);
  std::string order;
  for (int i = 1; i <= 9; ++i) {
    // Its next one comes when the last has ended.
    if (queue.CountOf("b") == 0) {
      queue.Push(NewJob(absl::StrCat("b", i), 1, "b"));
    }
    const auto job = queue.PopFitting(budget);
    order += job->tenant;
    queue.OnEnded(job->tenant);
  }
  EXPECT_EQ(order, "acbacbacb");
}

TEST(JobQueueTest, AnyNumberOfWorkersIsSharedEquallyOverTime) {
  for (const int workers : {1, 2, 3, 4, 5}) {
    SCOPED_TRACE(workers);
    MemoryBudget budget(100);
    JobQueue queue(2, kNoLimit);
    PushMany(queue, "a", 600);
    PushMany(queue, "b", 600);
    std::mt19937 random(workers);
    std::vector<std::string> running;
    std::map<std::string, int> starts;
    for (int i = 0; i < 600; ++i) {
      if (static_cast<int>(running.size()) == workers) {
        std::swap(running[random() % running.size()], running.back());
        queue.OnEnded(running.back());
        running.pop_back();
      }
      const auto job = queue.PopFitting(budget);
      job->Release();
      ++starts[job->tenant];
      running.push_back(job->tenant);
    }
    EXPECT_NEAR(starts["a"], starts["b"], 60);
  }
}

TEST(JobQueueTest, WhoHasOneRunningWaitsForWhoHasNone) {
  MemoryBudget budget(100);
  JobQueue queue(2, kNoLimit);
  PushMany(queue, "a", 2);
  EXPECT_EQ(IdOf(queue.PopFitting(budget)), "a1");
  queue.Push(NewJob("b1", 1, "b"));
  EXPECT_EQ(IdOf(queue.PopFitting(budget)), "b1");
  queue.OnEnded("b");
  queue.Push(NewJob("b2", 1, "b"));
  EXPECT_EQ(queue.JobsAhead("b2"), 0);
  queue.OnEnded("a");  // both have none now: a was served before b
  EXPECT_EQ(queue.JobsAhead("b2"), 1);
}

TEST(JobQueueTest, ATenantRunsNoMoreThanItMay) {
  MemoryBudget budget(100);
  JobQueue queue(2, /*max_running_per_tenant=*/2);
  PushMany(queue, "a", 4);
  EXPECT_EQ(IdOf(queue.PopFitting(budget)), "a1");
  EXPECT_EQ(IdOf(queue.PopFitting(budget)), "a2");
  EXPECT_EQ(IdOf(queue.PopFitting(budget)), "none");
  PushMany(queue, "b", 1);
  EXPECT_EQ(IdOf(queue.PopFitting(budget)), "b1");
  queue.OnEnded("a");
  EXPECT_EQ(IdOf(queue.PopFitting(budget)), "a3");
}

TEST(JobQueueTest, AJobThatComesBackHasItsPlaceAndItsTenantsTurn) {
  MemoryBudget budget(100);
  JobQueue queue(2, kNoLimit);
  PushMany(queue, "a", 3);
  PushMany(queue, "b", 3);
  const auto first = queue.PopFitting(budget);
  first->Release();
  queue.OnEnded("a");
  queue.Push(first);
  EXPECT_EQ(queue.JobsAhead("a1"), 0);
  EXPECT_THAT(Order(queue, budget),
              testing::ElementsAre("a1", "b1", "a2", "b2", "a3", "b3"));
}

TEST(JobQueueTest, AJobThatComesBackLeavesItsTenantAsOftenOvertaken) {
  MemoryBudget budget(100);
  JobQueue queue(2, kNoLimit);
  PushMany(queue, "b", 1);
  const auto first = queue.PopFitting(budget);
  PushMany(queue, "a", 20, /*priority=*/100);
  const std::shared_ptr<LiveJob> other = NewJob("b2", 1, "b");
  queue.Push(other);
  for (int i = 0; i < 5; ++i) queue.OnEnded(queue.PopFitting(budget)->tenant);
  queue.OnEnded("b");
  queue.Push(first);
  EXPECT_EQ(queue.JobsAhead("b1"), JobQueue::kMaxOvertakes - 5);
}

TEST(JobQueueTest, OwnPrioritiesOrderOwnJobsOnly) {
  MemoryBudget budget(100);
  JobQueue queue(2, kNoLimit);
  for (const int priority : {1, 100, 50}) {
    const auto job = NewJob(absl::StrCat("a", priority), 1, "a", priority);
    job->shared_priority = 0;
    queue.Push(job);
  }
  PushMany(queue, "b", 3);
  EXPECT_THAT(Order(queue, budget),
              testing::ElementsAre("a100", "b1", "a50", "b2", "a1", "b3"));
}

TEST(JobQueueTest, WhoIsOvertakenEightTimesHasATurn) {
  MemoryBudget budget(100);
  JobQueue queue(2, kNoLimit);
  PushMany(queue, "b", 2);
  PushMany(queue, "a", 20, /*priority=*/100);
  PushMany(queue, "c", 1, /*priority=*/-100);
  const int most = JobQueue::kMaxOvertakes;
  // Both were overtaken equally often: b came first.
  EXPECT_EQ(queue.JobsAhead("b1"), most);
  EXPECT_EQ(queue.JobsAhead("c1"), most + 1);
  EXPECT_EQ(queue.JobsAhead("b2"), 2 * most + 2);
  std::vector<std::string> order = Order(queue, budget);
  EXPECT_EQ(order[most], "b1");
  EXPECT_EQ(order[most + 1], "c1");
  EXPECT_EQ(order[2 * most + 2], "b2");
}

TEST(JobQueueTest, PositionsAreTheOrderOfStarts) {
  MemoryBudget budget(100'000);
  std::mt19937 random(5);
  for (int round = 0; round < 600; ++round) {
    SCOPED_TRACE(round);
    // Each third with a limit that binds, and with one that seldom does.
    const int most = std::vector<int>{kNoLimit, 2, 6}[round % 3];
    JobQueue queue(3, most);
    // What happened before does not matter either.
    const int steps = static_cast<int>(random() % 60);
    for (int step = 0; step < steps; ++step) {
      const auto job = random() % 4 == 0 ? queue.PopFitting(budget) : nullptr;
      if (job == nullptr) {
        auto next = NewJob(absl::StrCat(step), 1, absl::StrCat(random() % 4),
                           static_cast<int>(random() % 3));
        next->is_held = random() % 8 == 0;
        queue.Push(std::move(next));
        continue;
      }
      const auto what_then = random() % 3;
      if (what_then > 0) queue.OnEnded(job->tenant);
      if (what_then == 2) queue.Push(job);  // it did not run after all
    }
    std::map<std::string, int> ahead;
    for (int step = 0; step < steps; ++step) {
      const std::string id = absl::StrCat(step);
      ahead[id] = queue.JobsAhead(id);
    }
    int started = 0;
    const int free = queue.size() - queue.CountHeld();
    while (const auto job = queue.PopFitting(budget)) {
      EXPECT_EQ(ahead[job->id], started++) << job->id;
    }
    // Who has no turn yet, and then who is held, comes after them.
    EXPECT_TRUE(most != kNoLimit || started == free);
    while (const auto job = queue.PopAny()) {
      if (job->is_held) {
        EXPECT_EQ(ahead[job->id], free);
      } else {
        EXPECT_GE(ahead[job->id], started);
      }
    }
  }
}

TEST(JobQueueTest, NobodyIsForgottenWhateverComes) {
  constexpr int kSteps = 3000;
  MemoryBudget budget(100);
  JobQueue queue(3, kNoLimit);
  std::mt19937 random(11);
  std::set<std::string> waiting;
  std::vector<std::shared_ptr<LiveJob>> running;
  const auto end_one = [&] {
    const auto job = running.back();
    running.pop_back();
    job->Release();
    queue.OnEnded(job->tenant);
  };
  for (int step = 0; step < kSteps; ++step) {
    SCOPED_TRACE(step);
    const auto choice = random() % 4;
    const std::string id = absl::StrCat(step);
    if (choice < 2) {
      queue.Push(NewJob(id, random() % 100, absl::StrCat(random() % 3),
                        static_cast<int>(random() % 3)));
      waiting.insert(id);
    } else if (const auto job = queue.PopFitting(budget)) {
      EXPECT_EQ(waiting.erase(job->id), 1);
      running.push_back(job);
    } else if (!running.empty()) {
      end_one();
    }
    if (choice == 3 && !waiting.empty()) {
      const std::string gone = *waiting.begin();
      EXPECT_EQ(IdOf(queue.Remove(gone)), gone);
      waiting.erase(gone);
    }
    ASSERT_EQ(queue.size(), waiting.size());
    ASSERT_LE(budget.reserved_bytes(), budget.total_bytes());
  }
  while (!running.empty()) end_one();
  EXPECT_EQ(Order(queue, budget).size(), waiting.size());
  EXPECT_EQ(budget.reserved_bytes(), 0);
}

}  // namespace
}  // namespace isomatch
