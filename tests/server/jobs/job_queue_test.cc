#include "server/jobs/job_queue.h"

#include <memory>
#include <string>

#include <gtest/gtest.h>

namespace isomatch {
namespace {

std::shared_ptr<LiveJob> NewJob(const std::string& id, std::int64_t bytes) {
  auto job = std::make_shared<LiveJob>();
  job->id = id;
  job->mesh_bytes = 1;
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

TEST(JobQueueTest, CountsTheMeshesOfThoseThatWait) {
  MemoryBudget budget(100);
  JobQueue queue(2);
  for (const char* id : {"a", "b", "c"}) queue.Push(NewJob(id, 1));
  EXPECT_EQ(queue.mesh_bytes(), 3);
  EXPECT_EQ(IdOf(queue.Remove("b")), "b");
  EXPECT_EQ(IdOf(queue.Remove("b")), "none");
  EXPECT_EQ(IdOf(queue.PopFront()), "a");
  EXPECT_EQ(queue.mesh_bytes(), 1);
  EXPECT_EQ(queue.size(), 1);
}

}  // namespace
}  // namespace isomatch
