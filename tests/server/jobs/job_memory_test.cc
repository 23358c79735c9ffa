// What JobManager does when there is no memory.

#include <new>
#include <string>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/server/jobs/job_manager_fixture.h"

namespace isomatch {
namespace {

class JobMemoryTest : public JobManagerTest {};

TEST_F(JobMemoryTest, AFailedAllocationFailsThatJobOnly) {
  const std::string bad = Create();
  const std::string good = Create();
  during_match_ = [](const std::stop_token&) -> absl::Status {
    throw std::bad_alloc();
  };
  EXPECT_TRUE(workers_.RunNext());
  during_match_ = [](const std::stop_token&) { return absl::OkStatus(); };
  EXPECT_TRUE(workers_.RunNext());
  EXPECT_EQ(StateOf(bad), "FAILED");
  EXPECT_EQ(FailureOf(bad), "OUT_OF_MEMORY");
  EXPECT_EQ(StateOf(good), "SUCCEEDED");
  EXPECT_EQ(budget_.reserved_bytes(), 0);
}

TEST_F(JobMemoryTest, AJobThatFindsNoMemoryToStartOrToEndGivesItsSlotBack) {
  for (const JobState at : {JobState::kRunning, JobState::kSucceeded}) {
    const std::string bad = Create();
    const std::string good = Create();
    // Twice: what is said of the failure finds none at first, either.
    int left = 2;
    jobs_.before_update = [&](const JobRecord& record) {
      const bool is_it = record.id == bad && (record.state == at || left == 1);
      if (is_it && left-- > 0) throw std::bad_alloc();
    };
    EXPECT_TRUE(workers_.RunNext());
    EXPECT_TRUE(workers_.RunNext());
    EXPECT_EQ(StateOf(bad), "FAILED");
    EXPECT_EQ(FailureOf(bad), "OUT_OF_MEMORY");
    EXPECT_EQ(StateOf(good), "SUCCEEDED");
    EXPECT_EQ(manager_->load().running_jobs, 0);
    EXPECT_EQ(budget_.reserved_bytes(), 0);
    EXPECT_LE(left, 0);
    jobs_.before_update = {};
  }
}

}  // namespace
}  // namespace isomatch
