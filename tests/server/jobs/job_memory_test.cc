// What JobManager does when there is no memory.

#include <functional>
#include <memory>
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

/// The first time that a job gets there, nobody can be told.
std::function<void(const JobRecord&)> NoMemoryAt(JobState state) {
  return [state, is_first = true](const JobRecord& record) mutable {
    if (record.state == state && std::exchange(is_first, false)) {
      throw std::bad_alloc();
    }
  };
}

TEST_F(JobMemoryTest, AJobThatGoesBackToTheQueueIsInIt) {
  const std::string id = Create();
  before_state_ = NoMemoryAt(JobState::kQueued);
  blobs_.disk = absl::ResourceExhaustedError("disk full");
  EXPECT_TRUE(workers_.RunNext());
  EXPECT_EQ(StateOf(id), "QUEUED");
  EXPECT_EQ(manager_->load().queued_jobs, 1);
  blobs_.disk = absl::OkStatus();
  timers_.Advance(StorageGate::kFirstProbe);
  EXPECT_TRUE(workers_.RunNext());
  EXPECT_EQ(StateOf(id), "SUCCEEDED");
}

class EndWatcher : public JobWatcher {
 public:
  explicit EndWatcher(std::function<std::string()> state)
      : state_(std::move(state)) {}
  void OnJobChanged() override { seen = state_(); }
  std::string seen;

 private:
  const std::function<std::string()> state_;
};

TEST_F(JobMemoryTest, WatchersHearOfTheEndThoughTheLogDoesNot) {
  const std::string id = Create();
  const auto watcher =
      std::make_shared<EndWatcher>([&] { return StateOf(id); });
  manager_->watchers().Add(id, watcher);
  before_state_ = NoMemoryAt(JobState::kSucceeded);
  EXPECT_TRUE(workers_.RunNext());
  EXPECT_EQ(watcher->seen, "SUCCEEDED");
}

}  // namespace
}  // namespace isomatch
