// Jobs that do not stop, take all memory, or take the process down.

#include <optional>
#include <thread>
#include <tuple>
#include <vector>

#include "tests/server/jobs/job_manager_fixture.h"

namespace isomatch {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

/// What the next process reads.
class KeptTrace : public TraceStore {
 public:
  ProcessTrace Read() override { return last; }
  void Write(const ProcessTrace& trace) override { last = trace; }
  ProcessTrace last;
};

/// Workers that count how many threads they were given beside the first.
class GrowingExecutor : public ManualExecutor {
 public:
  void AddThread() override { ++added; }
  int added = 0;
};

/// A match plays what the others do meanwhile: the test's thread is its worker.
/// The records outlive each process.
class JobWatchTest : public JobManagerTest {
 protected:
  JobWatchTest() {
    limits_.durable = true;
    NextProcess();
  }
  ~JobWatchTest() override {
    manager_.reset();
    growing_.Clear();
  }

  void NextProcess() {
    manager_.reset();
    growing_.Clear();
    timers_.Clear();
    watch_.Clear();
    JobManager::Parts parts = MakeParts();
    parts.workers = &growing_;
    parts.watch = &watch_;
    parts.uptime = [this] { return uptime_; };
    parts.read_memory = [this] { return memory_; };
    parts.traces = limits_.durable ? &trace_ : nullptr;
    parts.on_stuck = [this](const JobRecord& record) {
      stuck_.push_back(record.id);
    };
    parts.on_give_up = [this](const std::string& reason) {
      given_up_.push_back(reason);
    };
    manager_ = std::make_unique<JobManager>(limits_, parts);
    manager_->Begin();
  }

  /// Lets time pass until the watch has looked again.
  void Pass(absl::Duration duration) {
    uptime_ += duration;
    watch_.Advance(absl::Milliseconds(200));
  }

  /// The first job that runs does this; the others succeed.
  void DuringFirstMatch(std::function<absl::Status()> act) {
    matches_begun_ = 0;
    during_match_ = [this, act = std::move(act)](const std::stop_token& stop) {
      stop_ = stop;
      if (++matches_begun_ == 1) return act();
      if (beside_) beside_();
      return absl::OkStatus();
    };
  }

  /// Runs the job that was created first; nothing is left of the process in
  /// the middle of its match, after `act`.
  void CrashDuringFirstMatch(std::function<void()> act) {
    DuringFirstMatch([act = std::move(act)]() -> absl::Status {
      act();
      throw Crashed();
    });
    EXPECT_THROW(growing_.RunNext(), Crashed);
    NextProcess();
  }

  struct Crashed {};

  JobRecord Record(const std::string& id) {
    return manager_->Get(caller_, id)->record;
  }

  JobManager::Limits limits_;
  GrowingExecutor growing_;
  ManualExecutor watch_;
  absl::Duration uptime_ = absl::ZeroDuration();
  JobManager::MemoryFigures memory_ = {
      .resident_bytes = 100, .expected_bytes = 200, .limit_bytes = 1000};
  KeptTrace trace_;
  int matches_begun_ = 0;
  /// What the jobs beside the first do.
  std::function<void()> beside_;
  std::stop_token stop_;
  std::vector<std::string> stuck_;
  std::vector<std::string> given_up_;
};

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

TEST_F(JobWatchTest, MemoryThatNoJobHasIsNoJobsFault) {
  memory_.resident_bytes = 1001;
  Pass(absl::Seconds(10));
  EXPECT_THAT(given_up_, IsEmpty());
}

// "The system ends the process for its memory", three times.
TEST_F(JobWatchTest, TheNeighbourOfAJobThatTakesTheServerDownSucceeds) {
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
    memory_.resident_bytes = 100;
  }
  EXPECT_EQ(FailureOf(poison), "CRASHED_REPEATEDLY");
  DuringFirstMatch([] { return absl::OkStatus(); });
  while (growing_.RunNext()) {
  }
  EXPECT_EQ(StateOf(innocent), "SUCCEEDED");
  EXPECT_EQ(Record(innocent).faults, 0);
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

}  // namespace
}  // namespace isomatch
