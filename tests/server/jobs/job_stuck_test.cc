// What workers that do not come back leave to the others.

#include <new>
#include <string>

#include "tests/server/jobs/job_watch_fixture.h"

namespace isomatch {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

/// Two workers.
class JobStuckTest : public JobWatchTest {
 protected:
  JobStuckTest() { Begin(2, /*durable=*/true); }

  void Begin(int workers, bool durable) {
    limits_.workers = workers;
    limits_.durable = durable;
    NextProcess();
  }

  /// Runs a job of one byte that does not stop, `act` once it is given up.
  std::string RunStuck(std::function<void()> act) {
    const std::string id = Create();
    DuringFirstMatch([this, id, act = std::move(act)] {
      EXPECT_THAT(manager_->Cancel(caller_, id), IsOk());
      Pass(absl::Seconds(10));
      act();
      return absl::OkStatus();  // too late
    });
    EXPECT_TRUE(growing_.RunNext());
    return id;
  }

  /// A job that has begun and waits for nothing.
  void ExpectOneRuns() {
    const std::string id = Create();
    EXPECT_TRUE(growing_.RunNext());
    EXPECT_EQ(StateOf(id), "SUCCEEDED");
  }
};

TEST_F(JobStuckTest, WhoNeedsAStuckOnesMemoryIsPassedWithoutANextProcess) {
  Begin(2, /*durable=*/false);
  std::string large;
  RunStuck([&] {
    large = Create(Needing(kBudget));
    for (int i = 0; i < limits_.max_passes + 2; ++i) ExpectOneRuns();
    EXPECT_EQ(StateOf(large), "QUEUED");
  });
  EXPECT_THAT(given_up_, IsEmpty());
  EXPECT_TRUE(growing_.RunNext());  // it has come back with its memory
  EXPECT_EQ(StateOf(large), "SUCCEEDED");
}

TEST_F(JobStuckTest, WhoNeedsAStuckOnesMemoryIsForTheNextProcess) {
  std::string large;
  RunStuck([&] {
    const std::string running = Create();
    large = Create(Needing(kBudget));
    EXPECT_THAT(given_up_, IsEmpty());  // nobody is stopped for it
    EXPECT_TRUE(growing_.RunNext());
    EXPECT_EQ(StateOf(running), "SUCCEEDED");
    EXPECT_THAT(given_up_, ElementsAre(HasSubstr("memory")));
  });
  NextProcess();
  EXPECT_TRUE(growing_.RunNext());
  EXPECT_EQ(StateOf(large), "SUCCEEDED");
}

TEST_F(JobStuckTest, WhoNeedsAStuckOnesMemoryIsPassedSoManyTimesOnly) {
  RunStuck([&] {
    Create();  // one runs at any time
    Create(Needing(kBudget));
    for (int i = 0; i < limits_.max_passes; ++i) {
      Create();
      EXPECT_TRUE(growing_.RunNext());
    }
    EXPECT_THAT(given_up_, IsEmpty());
    Create();
    EXPECT_TRUE(growing_.RunNext());
    EXPECT_FALSE(growing_.RunNext());
    EXPECT_THAT(given_up_, SizeIs(1));
  });
}

TEST_F(JobStuckTest, OneThatComesBackAfterAllRunsAgain) {
  const std::string id = Create();
  DuringFirstMatch([&] {
    memory_.resident_bytes = 1001;
    Pass(absl::ZeroDuration());
    EXPECT_TRUE(stop_.stop_requested());
    memory_.resident_bytes = 500;
    Pass(absl::Seconds(10));
    EXPECT_THAT(stuck_, ElementsAre(id));
    EXPECT_EQ(StateOf(id), "QUEUED");
    EXPECT_FALSE(growing_.RunNext());  // not while it has a worker
    return absl::OkStatus();
  });
  EXPECT_TRUE(growing_.RunNext());
  EXPECT_THAT(given_up_, IsEmpty());
  EXPECT_EQ(StateOf(id), "QUEUED");
  EXPECT_TRUE(growing_.RunNext());
  EXPECT_EQ(StateOf(id), "SUCCEEDED");
  EXPECT_FALSE(growing_.RunNext());
}

TEST_F(JobStuckTest, WithoutAThreadForTheNextOneTheProcessIsToEnd) {
  growing_.can_grow = false;
  RunStuck([&] { EXPECT_THAT(given_up_, ElementsAre(HasSubstr("thread"))); });
}

TEST_F(JobStuckTest, WithoutAThreadOrANextProcessOnlyWhatHasAThreadRuns) {
  Begin(2, /*durable=*/false);
  growing_.can_grow = false;
  RunStuck([&] {
    const std::string first = Create();
    const std::string second = Create();
    EXPECT_EQ(manager_->load().running_jobs, 1);
    EXPECT_EQ(manager_->load().queued_jobs, 1);
    EXPECT_TRUE(growing_.RunNext());
    EXPECT_TRUE(growing_.RunNext());
    EXPECT_EQ(StateOf(second), "SUCCEEDED");
  });
  Create();
  Create();
  EXPECT_EQ(manager_->load().running_jobs, 2);
}

TEST_F(JobStuckTest, AFailedAllocationWhileAWorkerIsGivenUpLosesNone) {
  Begin(1, /*durable=*/false);
  for (const bool of_store : {true, false}) {
    int failures = 0;
    const auto fail_once = [&] {
      if (failures++ == 0) throw std::bad_alloc();
    };
    if (of_store) {
      jobs_.before_update = [&](const JobRecord& record) {
        if (record.unresponsive) fail_once();
      };
    } else {
      before_stuck_ = fail_once;
    }
    const std::string id = RunStuck([&] {
      EXPECT_EQ(manager_->load().stuck_jobs, 1);
      EXPECT_EQ(manager_->load().running_jobs, 0);
      ExpectOneRuns();
    });
    EXPECT_GE(failures, 1);
    EXPECT_TRUE(Record(id).unresponsive);
    EXPECT_EQ(Record(id).faults, 1);
    EXPECT_EQ(manager_->load().stuck_jobs, 0);
    ExpectOneRuns();
    jobs_.before_update = {};
  }
}

}  // namespace
}  // namespace isomatch
