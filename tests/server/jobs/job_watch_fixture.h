#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include "tests/server/jobs/job_manager_fixture.h"

namespace isomatch {

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
  bool AddThread() override {
    if (can_grow) ++added;
    return can_grow;
  }
  int added = 0;
  bool can_grow = true;
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
    memory_.resident_bytes = 100;
    freed_bytes_ = 0;
    JobEnvironment environment = MakeEnvironment(limits_);
    environment.workers = &growing_;
    environment.watch = &watch_;
    environment.uptime = [this] {
      if (before_uptime_) before_uptime_();
      return uptime_;
    };
    environment.read_memory = [this] { return memory_; };
    environment.release_memory = [this] {
      memory_.resident_bytes -= std::exchange(freed_bytes_, 0);
    };
    environment.traces = limits_.durable ? &trace_ : nullptr;
    environment.on_stuck = [this](const JobRecord& record) {
      if (before_stuck_) before_stuck_();
      stuck_.push_back(record.id);
    };
    environment.on_give_up = [this](const std::string& reason) {
      given_up_.push_back(reason);
    };
    manager_ = std::make_unique<JobManager>(environment);
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

  JobLimits limits_;
  GrowingExecutor growing_;
  ManualExecutor watch_;
  absl::Duration uptime_ = absl::ZeroDuration();
  MemoryFigures memory_ = {
      .resident_bytes = 100, .expected_bytes = 200, .limit_bytes = 1000};
  /// Of what is resident, what only has to be given back.
  std::int64_t freed_bytes_ = 0;
  KeptTrace trace_;
  std::function<void()> before_uptime_;
  std::function<void()> before_stuck_;
  int matches_begun_ = 0;
  /// What the jobs beside the first do.
  std::function<void()> beside_;
  std::stop_token stop_;
  std::vector<std::string> stuck_;
  std::vector<std::string> given_up_;
};

}  // namespace isomatch
