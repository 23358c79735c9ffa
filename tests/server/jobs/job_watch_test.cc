// Jobs that do not stop, take all memory, or take the process down.

#include <optional>
#include <thread>
#include <tuple>
#include <vector>

#include "tests/server/jobs/job_watch_fixture.h"

namespace isomatch {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

TEST_F(JobWatchTest, StartsWhatCanThoughNobodySaidThatItCan) {
  auto others = budget_.Reserve(kBudget);
  ASSERT_THAT(others, IsOk());
  const std::string id = Create();
  Pass(absl::ZeroDuration());
  EXPECT_FALSE(growing_.RunNext());
  *others = MemoryBudget::Reservation();
  EXPECT_FALSE(growing_.RunNext());
  Pass(absl::ZeroDuration());
  EXPECT_TRUE(growing_.RunNext());
  EXPECT_EQ(StateOf(id), "SUCCEEDED");
}

TEST_F(JobWatchTest, AWorkerThatDoesNotComeBackCostsItsJobOnly) {
  limits_.workers = 2;
  NextProcess();
  const std::string id = Create();
  DuringFirstMatch([&] {
    EXPECT_THAT(manager_->Cancel(caller_, id), IsOk());
    Pass(absl::Seconds(9));
    EXPECT_EQ(manager_->load().running_jobs, 1);  // it may answer yet
    Pass(absl::Seconds(1));
    EXPECT_EQ(manager_->load().running_jobs, 0);
    EXPECT_EQ(manager_->load().stuck_jobs, 1);
    EXPECT_EQ(growing_.added, 1);
    EXPECT_EQ(budget_.reserved_bytes(), 1);  // it still has its memory
    for (int i = 0; i < 2; ++i) {
      const std::string other = Create();
      EXPECT_TRUE(growing_.RunNext());
      EXPECT_EQ(StateOf(other), "SUCCEEDED");
    }
    Pass(absl::Seconds(20));
    return absl::OkStatus();  // too late
  });
  EXPECT_TRUE(growing_.RunNext());
  EXPECT_THAT(stuck_, ElementsAre(id));
  EXPECT_THAT(given_up_, IsEmpty());
  EXPECT_EQ(StateOf(id), "CANCELLED");
  EXPECT_TRUE(Record(id).unresponsive);
  EXPECT_EQ(Record(id).faults, 1);
  EXPECT_EQ(manager_->load().stuck_jobs, 0);  // it has come back
  EXPECT_EQ(budget_.reserved_bytes(), 0);
}

TEST_F(JobWatchTest, AJobThatAnswersInTimeIsNotStuck) {
  const std::string id = Create();
  DuringFirstMatch([&] {
    EXPECT_THAT(manager_->Cancel(caller_, id), IsOk());
    Pass(absl::Seconds(9));
    return absl::CancelledError("");
  });
  EXPECT_TRUE(growing_.RunNext());
  Pass(absl::Seconds(20));
  EXPECT_THAT(stuck_, IsEmpty());
  EXPECT_FALSE(Record(id).unresponsive);
}

TEST_F(JobWatchTest, WhenAllWorkersAreStuckTheProcessIsToEnd) {
  const std::string id = Create();
  const std::string waiting = Create();
  DuringFirstMatch([&] {
    EXPECT_THAT(manager_->Cancel(caller_, id), IsOk());
    Pass(absl::Seconds(10));
    EXPECT_THAT(given_up_, SizeIs(1));
    EXPECT_EQ(growing_.added, 0);
    Pass(absl::Seconds(10));
    return absl::CancelledError("");
  });
  EXPECT_TRUE(growing_.RunNext());
  EXPECT_THAT(given_up_, ElementsAre(HasSubstr("all workers")));
  EXPECT_EQ(StateOf(id), "CANCELLED");
  EXPECT_EQ(StateOf(waiting), "QUEUED");
}

TEST_F(JobWatchTest, WithoutDurableStoresTheProcessGoesOn) {
  limits_.durable = false;
  NextProcess();
  const std::string id = Create();
  const std::string waiting = Create();
  DuringFirstMatch([&] {
    EXPECT_THAT(manager_->Cancel(caller_, id), IsOk());
    Pass(absl::Seconds(10));
    EXPECT_TRUE(growing_.RunNext());
    EXPECT_EQ(StateOf(waiting), "SUCCEEDED");
    return absl::CancelledError("");
  });
  EXPECT_TRUE(growing_.RunNext());
  EXPECT_EQ(growing_.added, 1);
  EXPECT_THAT(given_up_, IsEmpty());
}

TEST_F(JobWatchTest, TheServersRunLimitHoldsWhateverAJobAsksFor) {
  limits_.max_run_time = absl::Seconds(5);
  NextProcess();
  JobSpec patient = Needing(1);
  patient.run_timeout = absl::Hours(1);
  JobSpec quick = Needing(1);
  quick.run_timeout = absl::Seconds(2);
  for (const auto& [spec, limit, whose] :
       {std::tuple(Needing(1), 5, "--max-run-time"),
        std::tuple(patient, 5, "--max-run-time"),
        std::tuple(quick, 2, "its run_timeout")}) {
    const std::string id = Create(spec);
    EXPECT_EQ(Record(id).run_timeout, absl::Seconds(limit));
    DuringFirstMatch([&, limit = limit] {
      timers_.Advance(absl::Seconds(limit) - absl::Milliseconds(1));
      EXPECT_EQ(StateOf(id), "RUNNING");
      timers_.Advance(absl::Milliseconds(1));
      EXPECT_TRUE(stop_.stop_requested());
      return absl::CancelledError("");
    });
    EXPECT_TRUE(growing_.RunNext());
    EXPECT_EQ(FailureOf(id), "RUN_TIMEOUT");
    EXPECT_THAT(Record(id).error->message, HasSubstr(whose));
  }
}

TEST_F(JobWatchTest, AJobThatHoldsUpTheStopIsTriedThreeTimes) {
  limits_.unresponsive_grace = absl::Milliseconds(1);
  NextProcess();
  const std::string id = Create();
  for (int process = 1; process <= 3; ++process) {
    DuringFirstMatch([&] {
      manager_->Shutdown(absl::ZeroDuration());
      EXPECT_EQ(StateOf(id), process < 3 ? "QUEUED" : "FAILED");
      EXPECT_EQ(Record(id).faults, process);
      EXPECT_EQ(Record(id).attempt, process);
      return absl::OkStatus();  // too late
    });
    EXPECT_TRUE(growing_.RunNext());
    NextProcess();
  }
  EXPECT_EQ(FailureOf(id), "UNRESPONSIVE");
  EXPECT_TRUE(Record(id).unresponsive);
  EXPECT_THAT(given_up_, IsEmpty());
}

TEST_F(JobWatchTest, AJobThatAnswersAServersStopHasNoFault) {
  const std::string id = Create();
  for (int process = 1; process <= 5; ++process) {
    std::thread stopping;  // waits for the job
    DuringFirstMatch([&] {
      stopping = std::thread([&] { manager_->Shutdown(absl::ZeroDuration()); });
      while (!stop_.stop_requested()) std::this_thread::yield();
      return absl::CancelledError("");
    });
    EXPECT_TRUE(growing_.RunNext());
    stopping.join();
    EXPECT_EQ(StateOf(id), "QUEUED");
    EXPECT_EQ(Record(id).attempt, 0);
    EXPECT_EQ(Record(id).faults, 0);
    NextProcess();
  }
}

TEST_F(JobWatchTest, BeyondTheLimitTheMostSilentJobIsPutBack) {
  limits_.workers = 2;
  NextProcess();
  const std::string silent = Create();
  const std::string other = Create();
  bool other_was_asked = true;
  std::optional<std::stop_token> of_silent;
  matches_begun_ = 0;
  during_match_ = [&](const std::stop_token& stop) -> absl::Status {
    if (++matches_begun_ == 1) {
      of_silent = stop;
      uptime_ += absl::Seconds(3);
      EXPECT_TRUE(growing_.RunNext());  // the other one, beside it
      memory_.resident_bytes = 500;     // falls with its end
      return absl::CancelledError("");
    }
    if (matches_begun_ > 2) return absl::OkStatus();
    memory_.resident_bytes = 1001;
    Pass(absl::ZeroDuration());
    other_was_asked = stop.stop_requested();
    EXPECT_TRUE(of_silent->stop_requested());
    return absl::OkStatus();
  };
  EXPECT_TRUE(growing_.RunNext());
  EXPECT_FALSE(other_was_asked);
  EXPECT_EQ(StateOf(other), "SUCCEEDED");
  EXPECT_EQ(StateOf(silent), "QUEUED");
  EXPECT_EQ(Record(silent).faults, 1);
  EXPECT_TRUE(growing_.RunNext());
  EXPECT_EQ(StateOf(silent), "SUCCEEDED");
}

TEST_F(JobWatchTest, AJobWhoseEndDoesNotHelpHasNoFault) {
  const std::string id = Create();
  DuringFirstMatch([&] {
    memory_.resident_bytes = 1001;
    Pass(absl::ZeroDuration());
    EXPECT_TRUE(stop_.stop_requested());
    return absl::CancelledError("");
  });
  EXPECT_TRUE(growing_.RunNext());
  EXPECT_EQ(Record(id).faults, 0);
  EXPECT_EQ(Record(id).attempt, 0);
  DuringFirstMatch([&] {
    Pass(absl::Seconds(5));  // the memory is somebody else's
    EXPECT_FALSE(stop_.stop_requested());
    memory_.resident_bytes = 1200;  // it grows on
    Pass(absl::ZeroDuration());
    EXPECT_TRUE(stop_.stop_requested());
    return absl::OkStatus();  // just before it heard of it
  });
  EXPECT_TRUE(growing_.RunNext());
  EXPECT_EQ(StateOf(id), "SUCCEEDED");
}

TEST_F(JobWatchTest, AJobThatTakesAllMemoryThreeTimesFails) {
  const std::string id = Create();
  for (int time = 1; time <= 3; ++time) {
    DuringFirstMatch([&] {
      memory_.resident_bytes = 1001;
      Pass(absl::ZeroDuration());
      memory_.resident_bytes = 500;
      return absl::CancelledError("");
    });
    EXPECT_TRUE(growing_.RunNext());
  }
  EXPECT_EQ(FailureOf(id), "OUT_OF_MEMORY");
  EXPECT_FALSE(growing_.RunNext());
}

TEST_F(JobWatchTest, OneThatTakesAllMemoryAndDoesNotStopEndsTheProcess) {
  limits_.workers = 2;
  NextProcess();
  const std::string id = Create();
  DuringFirstMatch([&] {
    memory_.resident_bytes = 1001;
    Pass(absl::ZeroDuration());
    Pass(absl::Seconds(1));
    EXPECT_THAT(given_up_, IsEmpty());
    Pass(absl::Seconds(1));
    EXPECT_THAT(given_up_, ElementsAre(HasSubstr(id)));
    EXPECT_EQ(StateOf(id), "QUEUED");  // of the next process
    EXPECT_EQ(Record(id).faults, 1);
    return absl::OkStatus();
  });
  EXPECT_TRUE(growing_.RunNext());
  EXPECT_TRUE(Record(id).unresponsive);
}

TEST_F(JobWatchTest, FreedMemoryIsGivenBackBeforeAnyJobIsStopped) {
  Create();
  DuringFirstMatch([&] {
    memory_.resident_bytes = 1001;
    freed_bytes_ = 1;
    Pass(absl::ZeroDuration());
    EXPECT_FALSE(stop_.stop_requested());
    memory_.resident_bytes = 1200;
    Pass(absl::ZeroDuration());
    EXPECT_TRUE(stop_.stop_requested());
    return absl::CancelledError("");
  });
  EXPECT_TRUE(growing_.RunNext());
}

TEST_F(JobWatchTest, AJobThatIsPutBackKeepsItsPlaceAndItsTenantsTurn) {
  const auto create_of = [&](const std::string& tenant) {
    return manager_->Create({.tenant = tenant}, Needing(1))->record.id;
  };
  const std::string first = create_of("a");
  const std::string of_b = create_of("b");
  create_of("a");
  DuringFirstMatch([&] {
    memory_.resident_bytes = 1001;
    Pass(absl::ZeroDuration());
    return absl::CancelledError("");
  });
  EXPECT_TRUE(growing_.RunNext());
  EXPECT_EQ(StateOf(first), "QUEUED");
  EXPECT_TRUE(growing_.RunNext());
  EXPECT_EQ(StateOf(first), "SUCCEEDED");
  EXPECT_TRUE(growing_.RunNext());
  EXPECT_EQ(StateOf(of_b), "SUCCEEDED");
}

TEST_F(JobWatchTest, AJobThatFindsNoMemoryToBeginGivesItsWorkerBack) {
  const std::string bad = Create();
  const std::string good = Create();
  before_uptime_ = [&] {
    before_uptime_ = nullptr;
    throw std::bad_alloc();
  };
  EXPECT_TRUE(growing_.RunNext());
  EXPECT_EQ(FailureOf(bad), "OUT_OF_MEMORY");
  EXPECT_TRUE(growing_.RunNext());
  EXPECT_EQ(StateOf(good), "SUCCEEDED");
  EXPECT_EQ(manager_->load().running_jobs, 0);
  EXPECT_EQ(budget_.reserved_bytes(), 0);
}

TEST_F(JobWatchTest, MemoryThatNoJobHasIsNoJobsFault) {
  memory_.resident_bytes = 1001;
  Pass(absl::Seconds(10));
  EXPECT_THAT(given_up_, IsEmpty());
}

// "The system ends the process for its memory", three times.
TEST_F(JobWatchTest, TheNeighborOfAJobThatTakesTheServerDownSucceeds) {
  limits_.workers = 2;
  NextProcess();
  const std::string poison = Create();
  const std::string innocent = Create();
  for (int time = 1; time <= 3; ++time) {
    CrashDuringFirstMatch([&] {  // of the poison; the other runs beside it
      uptime_ += absl::Seconds(2);
      beside_ = [&] {
        memory_.resident_bytes = 900;
        Pass(absl::ZeroDuration());
        throw Crashed();
      };
      growing_.RunNext();
    });
    beside_ = nullptr;
  }
  EXPECT_EQ(FailureOf(poison), "CRASHED_REPEATEDLY");
  DuringFirstMatch([] { return absl::OkStatus(); });
  while (growing_.RunNext()) {
  }
  EXPECT_EQ(StateOf(innocent), "SUCCEEDED");
  EXPECT_EQ(Record(innocent).faults, 0);
  EXPECT_EQ(Record(innocent).attempt, 1);  // the others were not its own
}

TEST_F(JobWatchTest, MemoryThatWasThereWithoutJobsIsNoJobsFault) {
  memory_.resident_bytes = 900;
  Pass(absl::Milliseconds(200));
  const std::string id = Create();
  CrashDuringFirstMatch([&] { Pass(absl::Seconds(2)); });
  EXPECT_EQ(Record(id).faults, 0);
  memory_.resident_bytes = 100;
  Pass(absl::Milliseconds(200));
  // What a job before it has freed is nobody's either.
  CrashDuringFirstMatch([&] {
    memory_.resident_bytes = 900;
    freed_bytes_ = 700;
    Pass(absl::Seconds(2));
  });
  EXPECT_EQ(Record(id).faults, 0);
  CrashDuringFirstMatch([&] {
    memory_.resident_bytes = 900;
    Pass(absl::Seconds(2));
  });
  EXPECT_EQ(Record(id).faults, 1);
}

TEST_F(JobWatchTest, WhoRanBesideAStuckOneIsNotToBlame) {
  limits_.workers = 2;
  NextProcess();
  const std::string deaf = Create();
  const std::string innocent = Create();
  CrashDuringFirstMatch([&] {
    EXPECT_THAT(manager_->Cancel(caller_, deaf), IsOk());
    beside_ = [&] {
      Pass(absl::Seconds(10));
      EXPECT_THAT(stuck_, ElementsAre(deaf));
      ASSERT_THAT(trace_.last.jobs, SizeIs(2));
      EXPECT_TRUE(trace_.last.jobs[0].is_stuck);
      EXPECT_FALSE(trace_.last.jobs[1].is_stuck);
      throw Crashed();
    };
    growing_.RunNext();
  });
  EXPECT_EQ(StateOf(innocent), "QUEUED");
  EXPECT_EQ(Record(innocent).faults, 0);
  EXPECT_EQ(Record(innocent).attempt, 0);
}

TEST_F(JobWatchTest, AKillFromOutsideIsNobodysFault) {
  const std::string id = Create();
  for (int time = 1; time < limits_.max_attempts; ++time) {
    CrashDuringFirstMatch([&] { Pass(absl::Milliseconds(200)); });
    ASSERT_EQ(StateOf(id), "QUEUED");
    EXPECT_EQ(Record(id).faults, 0);
    EXPECT_EQ(Record(id).attempt, time);
    // Once it may be the job after all it runs alone.
    EXPECT_EQ(budget_.reserved_bytes(), time < 3 ? 1 : kBudget);
  }
  CrashDuringFirstMatch([] {});  // there is an end to it
  EXPECT_EQ(FailureOf(id), "CRASHED_REPEATEDLY");
}

TEST_F(JobWatchTest, OneThatDidNotAnswerIsToBlameAndNobodyElse) {
  limits_.workers = 2;
  NextProcess();
  const std::string deaf = Create();
  CrashDuringFirstMatch([&] {
    EXPECT_THAT(manager_->Cancel(caller_, deaf), IsOk());
    Pass(absl::Seconds(2));
    EXPECT_THAT(trace_.last.jobs, SizeIs(1));
    EXPECT_EQ(trace_.last.jobs[0].unanswered, absl::Seconds(2));
  });
  EXPECT_EQ(StateOf(deaf), "CANCELLED");
}

TEST_F(JobManagerTest, TheDeadlineHurriesTheMatchOnceItRuns) {
  JobSpec spec = Needing(1);
  spec.deadline = absl::Seconds(5);
  const std::string id = Create(std::move(spec));
  timers_.Advance(absl::Seconds(60));  // while it waits
  during_match_ = [&](const std::stop_token& stop) {
    timers_.Advance(absl::Seconds(4));
    EXPECT_FALSE(hurry_.stop_requested());
    timers_.Advance(absl::Seconds(1));
    EXPECT_TRUE(hurry_.stop_requested());
    EXPECT_FALSE(stop.stop_requested());
    return absl::OkStatus();
  };
  EXPECT_TRUE(workers_.RunNext());
  EXPECT_EQ(StateOf(id), "SUCCEEDED");
}

TEST_F(JobManagerTest, ADeadlineThatDoesNotComeLeavesNoTimer) {
  JobSpec spec = Needing(1);
  spec.deadline = absl::Seconds(5);
  Create(std::move(spec));
  EXPECT_TRUE(workers_.RunNext());
  EXPECT_EQ(timers_.live_timers(), 0);
  EXPECT_FALSE(hurry_.stop_requested());
}

}  // namespace
}  // namespace isomatch
