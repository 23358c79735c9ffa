#include "server/jobs/job_queue.h"

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

std::shared_ptr<LiveJob> NewJob(const std::string& id, std::int64_t bytes,
                                const std::string& tenant = "a",
                                int priority = 0) {
  auto job = std::make_shared<LiveJob>();
  job->id = id;
  job->tenant = tenant;
  job->priority = priority;
  job->memory_estimate_bytes = bytes;
  return job;
}

std::string IdOf(const std::shared_ptr<LiveJob>& job) {
  return job == nullptr ? "none" : job->id;
}

TEST(JobQueueTest, IsFirstComeFirstServedWhenAllFit) {
  MemoryBudget budget(100);
  JobQueue queue(2);
  queue.Push(NewJob("a", 10));
  queue.Push(NewJob("b", 10));
  EXPECT_EQ(IdOf(queue.PopFitting(budget)), "a");
  EXPECT_EQ(IdOf(queue.PopFitting(budget)), "b");
  EXPECT_EQ(IdOf(queue.PopFitting(budget)), "none");
}

TEST(JobQueueTest, CountsByPriority) {
  JobQueue queue(2);
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
  JobQueue queue(/*max_passes=*/2);
  queue.Push(NewJob("large", 80));
  for (const char* id : {"a", "b", "c"}) queue.Push(NewJob(id, 1));
  EXPECT_EQ(IdOf(queue.PopFitting(budget)), "a");
  EXPECT_EQ(IdOf(queue.PopFitting(budget)), "b");
  EXPECT_EQ(IdOf(queue.PopFitting(budget)), "none");  // though c would fit
  EXPECT_EQ(queue.JobsAhead("c"), 1);
}

TEST(JobQueueTest, APoppedJobHoldsItsReservation) {
  MemoryBudget budget(100);
  JobQueue queue(2);
  queue.Push(NewJob("a", 70));
  const auto job = queue.PopFitting(budget);
  EXPECT_EQ(budget.reserved_bytes(), 70);
  job->Release();
  EXPECT_EQ(budget.reserved_bytes(), 0);
}

TEST(JobQueueTest, IsLeftByAnyDoor) {
  MemoryBudget budget(100);
  JobQueue queue(2);
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
  JobQueue queue(2);
  queue.Push(NewJob("low", 1, "a", -5));
  queue.Push(NewJob("usual", 1, "a", 0));
  queue.Push(NewJob("high", 1, "b", 7));
  queue.Push(NewJob("high too", 1, "a", 7));
  EXPECT_EQ(queue.JobsAhead("low"), 3);
  EXPECT_EQ(queue.JobsAhead("high too"), 1);
  EXPECT_THAT(Order(queue, budget),
              testing::ElementsAre("high", "high too", "usual", "low"));
}

TEST(JobQueueTest, TenantsTakeTurns) {
  MemoryBudget budget(100);
  JobQueue queue(2);
  for (const char* id : {"a1", "a2", "a3", "a4"}) {
    queue.Push(NewJob(id, 1, "a"));
  }
  queue.Push(NewJob("b1", 1, "b"));
  queue.Push(NewJob("b2", 1, "b"));
  queue.Push(NewJob("c1", 1, "c"));
  EXPECT_EQ(queue.JobsAhead("c1"), 2);
  EXPECT_EQ(queue.JobsAhead("a2"), 3);
  // None has ended: each that runs counts.
  std::vector<std::string> order;
  while (const auto job = queue.PopFitting(budget)) order.push_back(job->id);
  EXPECT_THAT(order,
              testing::ElementsAre("a1", "b1", "c1", "a2", "b2", "a3", "a4"));
}

TEST(JobQueueTest, WhoHasOneRunningWaitsForWhoHasNone) {
  MemoryBudget budget(100);
  JobQueue queue(2);
  queue.Push(NewJob("a1", 1, "a"));
  queue.Push(NewJob("a2", 1, "a"));
  EXPECT_EQ(IdOf(queue.PopFitting(budget)), "a1");
  queue.Push(NewJob("b1", 1, "b"));
  EXPECT_EQ(IdOf(queue.PopFitting(budget)), "b1");
  queue.OnEnded("b");
  queue.Push(NewJob("b2", 1, "b"));
  EXPECT_EQ(queue.JobsAhead("b2"), 0);
  queue.OnEnded("a");  // both have none now: first come first served
  EXPECT_EQ(queue.JobsAhead("b2"), 1);
}

TEST(JobQueueTest, NobodyIsForgottenWhateverComes) {
  constexpr int kSteps = 3000;
  MemoryBudget budget(100);
  JobQueue queue(3);
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
