#include "server/jobs/job_manager.h"

#include <atomic>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/sha256.h"
#include "server/machine/thread_pool.h"
#include "tests/server/jobs/job_manager_fixture.h"

namespace isomatch {
namespace {

using testing::_;
using testing::ElementsAre;

TEST_F(JobManagerTest, AJobIsQueuedRunsAndSucceeds) {
  const std::string id = Create();
  EXPECT_EQ(StateOf(id), "QUEUED");
  during_match_ = [&](const std::stop_token&) {
    const JobRecord record = manager_->Get(caller_, id)->record;
    EXPECT_EQ(record.state, JobState::kRunning);
    EXPECT_EQ(record.progress.total_fraction, 0.25);
    EXPECT_EQ(budget_.reserved_bytes(), 1);
    return absl::OkStatus();
  };
  EXPECT_TRUE(workers_.RunNext());
  EXPECT_EQ(StateOf(id), "SUCCEEDED");
  EXPECT_EQ(budget_.reserved_bytes(), 0);
  EXPECT_THAT(history_, ElementsAre("QUEUED", "RUNNING", "SUCCEEDED"));
  const auto map = manager_->GetPart(caller_, id, ResultPart::kMap);
  ASSERT_THAT(map, IsOk());
  EXPECT_EQ(*map->bytes, std::string("\1\0\0\0", 4));
  EXPECT_EQ(manager_->Get(caller_, id)->record.progress.total_fraction, 1);
  EXPECT_EQ(
      ReasonOf(
          manager_->GetPart(caller_, id, ResultPart::kConfidence).status()),
      "RESULT_PART_MISSING");
}

TEST_F(JobManagerTest, OnlyAsManyJobsRunAsThereAreWorkers) {
  Restart({.workers = 2});
  for (int i = 0; i < 4; ++i) Create();
  EXPECT_EQ(manager_->load().running_jobs, 2);
  EXPECT_EQ(manager_->load().queued_jobs, 2);
  EXPECT_EQ(manager_->Get(caller_, "job4")->queue_position, 1);
  EXPECT_TRUE(workers_.RunNext());
  EXPECT_EQ(manager_->load().queued_jobs, 1);
  EXPECT_EQ(manager_->Get(caller_, "job4")->queue_position, 0);
}

TEST_F(JobManagerTest, AFullQueueRefusesAndSaysWhenToTryAgain) {
  Restart({.max_queued_jobs = 2});
  for (int i = 0; i < 3; ++i) Create();  // one runs, two wait
  const absl::Status refused = manager_->Create(caller_, Needing(1)).status();
  EXPECT_THAT(refused, StatusIs(absl::StatusCode::kResourceExhausted, _));
  EXPECT_EQ(ReasonOf(refused), "QUEUE_FULL");
  EXPECT_TRUE(DetailsOf(refused).retry_after);
  EXPECT_TRUE(workers_.RunNext());
  EXPECT_THAT(manager_->Create(caller_, Needing(1)), IsOk());
}

TEST_F(JobManagerTest, OneTenantCannotFillTheQueue) {
  Restart({.max_queued_jobs = 10, .tenant = {.queued_jobs = 1}});
  for (int i = 0; i < 2; ++i) Create();  // one runs, one waits
  const absl::Status refused = manager_->Create(caller_, Needing(1)).status();
  EXPECT_THAT(refused, StatusIs(absl::StatusCode::kResourceExhausted, _));
  EXPECT_EQ(ReasonOf(refused), "TENANT_QUOTA");
  EXPECT_TRUE(DetailsOf(refused).retry_after);
  EXPECT_THAT(manager_->Create({.tenant = "other"}, Needing(1)), IsOk());
}

TEST_F(JobManagerTest, OneTenantCannotTakeAllPlacesAtOnce) {
  Restart({.max_queued_jobs = 10, .tenant = {.queued_jobs = 2}});
  std::vector<JobIntake::SeatPtr> seats;
  for (int i = 0; i < 2; ++i) {
    auto seat = manager_->TakeSeat(caller_, "");
    ASSERT_THAT(seat, IsOk());
    seats.push_back(*std::move(seat));
  }
  EXPECT_EQ(ReasonOf(manager_->TakeSeat(caller_, "").status()), "TENANT_QUOTA");
  EXPECT_THAT(manager_->TakeSeat({.tenant = "other"}, ""), IsOk());
  seats.pop_back();
  EXPECT_THAT(manager_->TakeSeat(caller_, ""), IsOk());
}

TEST_F(JobManagerTest, OneTenantCannotFillTheStore) {
  Restart({.tenant = {.stored_bytes = 100}});
  const auto with_input = [](char fill, std::size_t size) {
    JobSpec spec = Needing(1);
    std::string bytes(size, fill);
    const std::string sha256 = Sha256Hex(bytes);
    spec.inputs.push_back({sha256, std::move(bytes)});
    return spec;
  };
  ASSERT_THAT(manager_->Create(caller_, with_input('a', 60)), IsOk());
  const absl::Status refused =
      manager_->Create(caller_, with_input('b', 60)).status();
  EXPECT_THAT(refused, StatusIs(absl::StatusCode::kResourceExhausted, _));
  EXPECT_EQ(ReasonOf(refused), "STORAGE_QUOTA");
  // What is there already takes no more room; others have their own.
  EXPECT_THAT(manager_->Create(caller_, with_input('a', 60)), IsOk());
  EXPECT_THAT(manager_->Create({.tenant = "other"}, with_input('b', 60)),
              IsOk());
  // What no job needs any more gives way.
  while (workers_.RunNext()) {
  }
  EXPECT_THAT(manager_->Create(caller_, with_input('b', 60)), IsOk());
}

TEST_F(JobManagerTest, APlaceIsTakenUntilItGoes) {
  Restart({.max_queued_jobs = 1});
  JobSpec spec = Needing(1);
  spec.request_id = "r";
  Create(spec);  // runs
  auto seat = manager_->TakeSeat(caller_, "");
  ASSERT_THAT(seat, IsOk());
  EXPECT_EQ(ReasonOf(manager_->TakeSeat(caller_, "").status()), "QUEUE_FULL");
  EXPECT_THAT(manager_->Create(caller_, Needing(1), *seat), IsOk());
  seat->reset();
  EXPECT_EQ(ReasonOf(manager_->TakeSeat(caller_, "").status()), "QUEUE_FULL");
  EXPECT_TRUE(workers_.RunNext());  // and the other runs
  EXPECT_THAT(manager_->TakeSeat(caller_, ""), IsOk());
}

TEST_F(JobManagerTest, ARequestThatMadeAJobBeforeNeedsNoPlace) {
  Restart({.max_queued_jobs = 1});
  JobSpec spec = Needing(1);
  spec.request_id = "r";
  Create(spec);
  Create();
  EXPECT_EQ(ReasonOf(manager_->TakeSeat(caller_, "s").status()), "QUEUE_FULL");
  const auto seat = manager_->TakeSeat(caller_, "r");
  ASSERT_THAT(seat, IsOk());
  EXPECT_EQ(*seat, nullptr);
  EXPECT_EQ(ReasonOf(manager_->TakeSeat({.tenant = "other"}, "r").status()),
            "QUEUE_FULL");
}

TEST_F(JobManagerTest, APlaceThatComesWhileTheRequestIsLookedUpIsTaken) {
  Restart({.max_queued_jobs = 1});
  Create();  // runs
  Create();  // waits, until the other has ended
  jobs_.before_find = [this] { EXPECT_TRUE(workers_.RunNext()); };
  const auto seat = manager_->TakeSeat(caller_, "new");
  ASSERT_THAT(seat, IsOk());
  EXPECT_NE(*seat, nullptr);
  EXPECT_EQ(ReasonOf(manager_->TakeSeat(caller_, "").status()), "QUEUE_FULL");
}

TEST_F(JobManagerTest, OthersDoNotSeeATenantsJobs) {
  const Caller mine = {"mine", Role::kSubmit};
  const Caller other = {"other", Role::kSubmit};
  JobSpec spec = Needing(1);
  spec.request_id = "r";
  const std::string id = manager_->Create(mine, spec)->record.id;
  EXPECT_EQ(ReasonOf(manager_->Get(other, id).status()), "JOB_NOT_FOUND");
  EXPECT_EQ(ReasonOf(manager_->Cancel(other, id).status()), "JOB_NOT_FOUND");
  EXPECT_THAT(*manager_->List(other, {}), testing::IsEmpty());
  EXPECT_THAT(*manager_->List(mine, {}), testing::SizeIs(1));
  EXPECT_THAT(*manager_->List(caller_, {}), testing::SizeIs(1));  // an admin
  EXPECT_NE(manager_->Create(other, spec)->record.id, id);  // its own request r
  while (workers_.RunNext()) {
  }
  EXPECT_EQ(ReasonOf(manager_->GetPart(other, id, ResultPart::kMap).status()),
            "JOB_NOT_FOUND");
  EXPECT_EQ(ReasonOf(manager_->Delete(other, id)), "JOB_NOT_FOUND");
  EXPECT_THAT(manager_->GetPart(mine, id, ResultPart::kMap), IsOk());
  EXPECT_THAT(manager_->Delete(caller_, id), IsOk());
}

TEST_F(JobManagerTest, InputsArePinnedUntilTheJobIsTerminal) {
  const std::string bytes(kBlobBytes / 2, 'i');
  JobSpec spec = Needing(1);
  spec.inputs = {{Sha256Hex(bytes), bytes}};
  const std::string id = Create(spec);
  EXPECT_FALSE(AllRoomIsFree());
  EXPECT_TRUE(workers_.RunNext());
  EXPECT_EQ(StateOf(id), "SUCCEEDED");
  ASSERT_THAT(manager_->Delete(caller_, id), IsOk());
  EXPECT_TRUE(AllRoomIsFree());
}

TEST_F(JobManagerTest, InputsThatCannotBeKeptRefuseTheJob) {
  JobSpec spec = Needing(1);
  const std::string small = "small";
  const std::string large(kBlobBytes + 1, 'i');
  spec.inputs = {{Sha256Hex(small), small}, {Sha256Hex(large), large}};
  EXPECT_EQ(ReasonOf(manager_->Create(caller_, spec).status()),
            "STORAGE_FAILED");
  EXPECT_TRUE(AllRoomIsFree());
  spec.inputs = {{Sha256Hex(small), small}, {Sha256Hex(large), std::nullopt}};
  EXPECT_EQ(ReasonOf(manager_->Create(caller_, spec).status()), "MESH_MISSING");
  EXPECT_TRUE(AllRoomIsFree());
  EXPECT_EQ(manager_->load().queued_jobs, 0);
  EXPECT_THAT(*manager_->List(caller_, {}), testing::IsEmpty());
}

TEST_F(JobManagerTest, WhatNeverFitsIsRefusedAtOnce) {
  EXPECT_EQ(ReasonOf(manager_->Create(caller_, Needing(kBudget + 1)).status()),
            "JOB_NEEDS_MORE_MEMORY_THAN_BUDGET");
  EXPECT_THAT(manager_->Create(caller_, Needing(kBudget)), IsOk());
}

TEST_F(JobManagerTest, ASmallJobPassesOneThatWaitsForMemory) {
  Restart({.workers = 3});
  const std::string first = Create(Needing(600));
  const std::string large = Create(Needing(600));
  const std::string small = Create(Needing(300));
  EXPECT_EQ(manager_->load().running_jobs, 2);
  EXPECT_EQ(budget_.reserved_bytes(), 900);
  EXPECT_TRUE(workers_.RunNext());
  EXPECT_TRUE(workers_.RunNext());
  EXPECT_EQ(StateOf(small), "SUCCEEDED");
  EXPECT_EQ(StateOf(large), "QUEUED");  // posted, as the first one has gone
  EXPECT_TRUE(workers_.RunNext());
  EXPECT_EQ(StateOf(large), "SUCCEEDED");
}

TEST_F(JobManagerTest, ACancelledQueuedJobNeverRuns) {
  const std::string running = Create();
  const std::string queued = Create();
  EXPECT_EQ(manager_->Cancel(caller_, queued)->record.state,
            JobState::kCancelled);
  EXPECT_EQ(manager_->load().queued_jobs, 0);
  while (workers_.RunNext()) {
  }
  EXPECT_EQ(matches_, 1);
  EXPECT_EQ(StateOf(running), "SUCCEEDED");
  EXPECT_EQ(StateOf(queued), "CANCELLED");
}

TEST_F(JobManagerTest, ACancelledJobThatHoldsUpTheQueueFreesIt) {
  Restart({.workers = 2, .max_passes = 0});
  Create(Needing(600));
  const std::string blocking = Create(Needing(600));
  Create(Needing(300));
  EXPECT_EQ(manager_->load().running_jobs, 1);
  ASSERT_THAT(manager_->Cancel(caller_, blocking), IsOk());
  EXPECT_EQ(manager_->load().running_jobs, 2);
}

TEST_F(JobManagerTest, ACancelledRunningJobIsAskedToStop) {
  const std::string id = Create();
  during_match_ = [&](const std::stop_token& stop) -> absl::Status {
    EXPECT_FALSE(stop.stop_requested());
    EXPECT_THAT(manager_->Cancel(caller_, id), IsOk());
    EXPECT_TRUE(stop.stop_requested());
    EXPECT_EQ(budget_.reserved_bytes(), 1);  // it still runs
    return absl::CancelledError("cancelled");
  };
  EXPECT_TRUE(workers_.RunNext());
  EXPECT_EQ(StateOf(id), "CANCELLED");
  EXPECT_EQ(budget_.reserved_bytes(), 0);
  EXPECT_THAT(history_, ElementsAre("QUEUED", "RUNNING", "CANCELLED"));
}

TEST_F(JobManagerTest, AResultThatComesAfterTheCancelIsDropped) {
  const std::string id = Create();
  during_match_ = [&](const std::stop_token&) {
    return manager_->Cancel(caller_, id).status();
  };
  EXPECT_TRUE(workers_.RunNext());
  EXPECT_EQ(StateOf(id), "CANCELLED");
  EXPECT_EQ(ReasonOf(manager_->GetPart(caller_, id, ResultPart::kMap).status()),
            "JOB_NOT_SUCCEEDED");
  EXPECT_EQ(manager_->load().running_jobs, 0);
}

TEST_F(JobManagerTest, ATerminalJobStaysAsItIs) {
  const std::string id = Create();
  EXPECT_TRUE(workers_.RunNext());
  EXPECT_EQ(ReasonOf(manager_->Cancel(caller_, id).status()), "JOB_TERMINAL");
  EXPECT_EQ(StateOf(id), "SUCCEEDED");
  EXPECT_EQ(ReasonOf(manager_->Cancel(caller_, "nobody").status()),
            "JOB_NOT_FOUND");
}

TEST_F(JobManagerTest, TheQueueTimeoutFiresWhileTheWorkerIsBusy) {
  const std::string running = Create();
  JobSpec spec = Needing(1);
  spec.queue_timeout = absl::Seconds(5);
  const std::string queued = Create(std::move(spec));
  during_match_ = [&](const std::stop_token&) {
    timers_.Advance(absl::Seconds(4));
    EXPECT_EQ(StateOf(queued), "QUEUED");
    timers_.Advance(absl::Seconds(1));
    EXPECT_EQ(StateOf(queued), "FAILED");
    return absl::OkStatus();
  };
  EXPECT_TRUE(workers_.RunNext());
  EXPECT_EQ(FailureOf(queued), "QUEUE_TIMEOUT");
  EXPECT_EQ(StateOf(running), "SUCCEEDED");
  EXPECT_FALSE(workers_.RunNext());
}

TEST_F(JobManagerTest, TheQueueTimeoutEndsWhenTheJobStarts) {
  JobSpec spec = Needing(1);
  spec.queue_timeout = absl::Seconds(5);
  Create(std::move(spec));
  EXPECT_EQ(timers_.live_timers(), 1);
  during_match_ = [&](const std::stop_token&) {
    EXPECT_EQ(timers_.live_timers(), 0);
    return absl::OkStatus();
  };
  EXPECT_TRUE(workers_.RunNext());
}

TEST_F(JobManagerTest, TheRunTimeoutFailsTheJobThoughItsMatchHangs) {
  JobSpec spec = Needing(1);
  spec.queue_timeout = absl::Seconds(1);  // must not count while it runs
  spec.run_timeout = absl::Seconds(5);
  const std::string id = Create(std::move(spec));
  during_match_ = [&](const std::stop_token& stop) {
    timers_.Advance(absl::Seconds(4));
    EXPECT_EQ(StateOf(id), "RUNNING");
    timers_.Advance(absl::Seconds(1));
    EXPECT_EQ(StateOf(id), "FAILED");
    EXPECT_TRUE(stop.stop_requested());
    return absl::OkStatus();
  };
  EXPECT_TRUE(workers_.RunNext());
  EXPECT_EQ(FailureOf(id), "RUN_TIMEOUT");
  EXPECT_EQ(timers_.live_timers(), 0);
}

TEST_F(JobManagerTest, AJobThatEndsInTimeLeavesNoTimer) {
  JobSpec spec = Needing(1);
  spec.queue_timeout = absl::Seconds(5);
  spec.run_timeout = absl::Seconds(5);
  const std::string id = Create(std::move(spec));
  EXPECT_TRUE(workers_.RunNext());
  EXPECT_EQ(timers_.live_timers(), 0);
  EXPECT_EQ(StateOf(id), "SUCCEEDED");
}

TEST_F(JobManagerTest, TheSameRequestAgainIsTheSameJob) {
  JobSpec spec = Needing(1);
  spec.request_id = "r";
  spec.request_sha256 = "1";
  const std::string id = Create(spec);
  EXPECT_EQ(Create(spec), id);
  EXPECT_TRUE(workers_.RunNext());
  EXPECT_EQ(Create(spec), id);
  EXPECT_FALSE(workers_.RunNext());
  spec.request_sha256 = "2";
  EXPECT_EQ(ReasonOf(manager_->Create(caller_, spec).status()),
            "REQUEST_ID_REUSED");
}

TEST_F(JobManagerTest, ValidateOnlyKeepsNothing) {
  JobSpec spec = Needing(7);
  spec.validate_only = true;
  const auto snapshot = manager_->Create(caller_, std::move(spec));
  ASSERT_THAT(snapshot, IsOk());
  EXPECT_EQ(snapshot->record.id, "");
  EXPECT_EQ(snapshot->record.memory_estimate_bytes, 7);
  EXPECT_TRUE(manager_->List(caller_, {})->empty());
  EXPECT_FALSE(workers_.RunNext());
}

TEST_F(JobManagerTest, OnlyTerminalJobsAreDeleted) {
  const std::string id = Create();
  EXPECT_EQ(ReasonOf(manager_->Delete(caller_, id)), "JOB_NOT_TERMINAL");
  EXPECT_TRUE(workers_.RunNext());
  EXPECT_THAT(manager_->Delete(caller_, id), IsOk());
  EXPECT_EQ(ReasonOf(manager_->Delete(caller_, id)), "JOB_NOT_FOUND");
}

TEST_F(JobManagerTest, DrainingCancelsTheQueueAndTakesNoMore) {
  const std::string running = Create();
  const std::string queued = Create();
  manager_->BeginDrain();
  EXPECT_EQ(StateOf(queued), "CANCELLED");
  EXPECT_EQ(ReasonOf(manager_->Create(caller_, Needing(1)).status()),
            "DRAINING");
  EXPECT_TRUE(workers_.RunNext());
  EXPECT_EQ(StateOf(running), "SUCCEEDED");
}

TEST_F(JobManagerTest, ShutdownCancelsWhatRunsLongerThanTheDrain) {
  std::atomic<bool> started = false;
  during_match_ = [&](const std::stop_token& stop) -> absl::Status {
    started = true;
    while (!stop.stop_requested()) std::this_thread::yield();
    return absl::CancelledError("cancelled");
  };
  const std::string id = Create();
  std::thread worker([&] { workers_.RunNext(); });
  while (!started) std::this_thread::yield();
  manager_->Shutdown(absl::Milliseconds(20));
  EXPECT_EQ(manager_->load().running_jobs, 0);
  worker.join();
  EXPECT_EQ(StateOf(id), "CANCELLED");
}

/// Counts its calls.
class CountingWatcher : public JobWatcher {
 public:
  void OnJobChanged() override { ++calls; }
  std::atomic<int> calls = 0;
};

TEST_F(JobManagerTest, WatchersAreToldOfEveryChangeUntilTheyAreRemoved) {
  const auto watcher = std::make_shared<CountingWatcher>();
  const std::string id = Create();
  manager_->watchers().Add(id, watcher);
  EXPECT_TRUE(workers_.RunNext());
  EXPECT_EQ(watcher->calls, 3);  // running, progress, succeeded
  manager_->watchers().Remove(id, watcher.get());
  ASSERT_THAT(manager_->Delete(caller_, id), IsOk());
  EXPECT_EQ(watcher->calls, 3);
}

/// Looks what was counted when it is told.
class HistoryWatcher : public JobWatcher {
 public:
  explicit HistoryWatcher(const std::vector<std::string>* history)
      : history_(history) {}
  void OnJobChanged() override { seen = history_->back(); }
  std::string seen;

 private:
  const std::vector<std::string>* const history_;
};

TEST_F(JobManagerTest, AChangeIsCountedBeforeWatchersAreTold) {
  const auto watcher = std::make_shared<HistoryWatcher>(&history_);
  const std::string id = Create();
  manager_->watchers().Add(id, watcher);
  EXPECT_TRUE(workers_.RunNext());
  EXPECT_EQ(watcher->seen, "SUCCEEDED");
}

/// Real threads: every job ends once, whatever comes at the same time.
TEST_F(JobManagerTest, JobsCancelledAndTimedOutByManyThreadsAllEnd) {
  ThreadPool workers(3);
  ThreadPool timers(1);
  during_match_ = [](const std::stop_token& stop) -> absl::Status {
    for (int i = 0; i < 200 && !stop.stop_requested(); ++i) {
      std::this_thread::yield();
    }
    return stop.stop_requested() ? absl::CancelledError("") : absl::OkStatus();
  };
  MatchEngine engine = FakeEngine();
  engine.match =
      [this](auto&&, auto&&, auto&&, auto&&,
             const MatchControl& control) -> absl::StatusOr<Correspondence> {
    const absl::Status status = during_match_(control.stop);
    if (!status.ok()) return status;
    return Correspondence();
  };
  const JobRunner runner(
      engine, [](auto&&...) { return std::string(); }, absl::Now, no_cache_);
  JobEnvironment environment =
      MakeEnvironment({.workers = 3, .max_queued_jobs = 10});
  environment.on_state = [](const JobRecord&) {};
  environment.workers = &workers;
  environment.timers = &timers;
  environment.runner = &runner;
  JobManager manager(environment);
  std::vector<std::thread> clients;
  for (int c = 0; c < 4; ++c) {
    clients.emplace_back([&, c] {
      for (int i = 0; i < 200; ++i) {
        JobSpec spec = Needing(1 + (i * 131) % kBudget);
        if (i % 3 == 0) spec.run_timeout = absl::Microseconds(50);
        if (i % 5 == 0) spec.queue_timeout = absl::Microseconds(50);
        const auto made = manager.Create(caller_, std::move(spec));
        if (made.ok() && (i + c) % 2 == 0) {
          (void)manager.Cancel(caller_, made->record.id);
        }
      }
    });
  }
  for (std::thread& client : clients) client.join();
  manager.Shutdown(absl::Seconds(20));
  EXPECT_EQ(budget_.reserved_bytes(), 0);
  EXPECT_EQ(manager.load().queued_jobs, 0);
  const auto jobs = manager.List(caller_, {.limit = 1000});
  ASSERT_THAT(jobs, IsOk());
  for (const JobSnapshot& job : *jobs) {
    EXPECT_TRUE(IsTerminal(job.record.state)) << job.record.id;
  }
}

}  // namespace
}  // namespace isomatch
