#include <thread>

#include "absl/time/clock.h"
#include "core/base/sha256.h"
#include "tests/server/jobs/job_manager_fixture.h"
#include "tests/server/storage/fake_journal.h"

namespace isomatch {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

/// A manager with durable stores. The blobs outlive a crash, but not their
/// pins; of the jobs what the journal has.
class JobRecoveryTest : public JobManagerTest {
 protected:
  JobRecoveryTest() {
    environment_ = MakeEnvironment();
    Crash();
  }

  ~JobRecoveryTest() override {
    // Their jobs have reservations of our budgets.
    workers_.Clear();
    timers_.Clear();
    manager_.reset();
  }

  /// The process ends without a word and starts again.
  void Crash() {
    workers_.Clear();  // tasks of the manager that is no more
    timers_.Clear();
    manager_.reset();
    blobs_after_.push_back(std::make_unique<MemoryBlobStore>(kBlobBytes));
    for (const auto& [sha256, bytes] : all_blobs_) {
      const absl::Status put = blobs_after_.back()->Put(
          {caller_.tenant, sha256}, bytes, Keep::kWhileRoom);
      EXPECT_THAT(put, IsOk());
    }
    durable_jobs_ = std::make_unique<MemoryJobStore>(
        journal_.Records(), &journal_,
        [this](const absl::Status& error) { errors_.push_back(error); });
    environment_.jobs = durable_jobs_.get();
    environment_.blobs = blobs_after_.back().get();
    environment_.budget =
        budgets_.emplace_back(std::make_unique<MemoryBudget>(budget_bytes_))
            .get();
    environment_.now = [this] { return now_; };
    environment_.uptime = [this] { return now_ - absl::UnixEpoch(); };
    limits_.durable = true;
    environment_.limits = limits_;
    manager_ = std::make_unique<JobManager>(environment_);
    manager_->Begin();
  }

  /// A job with an input blob.
  std::string CreateWithInput(int bytes = 1) {
    JobSpec spec = Needing(bytes);
    const std::string input = absl::StrCat("input ", ++inputs_);
    spec.inputs = {{Sha256Hex(input), input}};
    all_blobs_[Sha256Hex(input)] = input;
    return Create(spec);
  }

  /// Runs the next job up to the middle of its match and crashes there.
  void CrashInMatch() {
    struct Crashed {};
    during_match_ = [](const std::stop_token&) -> absl::Status {
      throw Crashed();
    };
    EXPECT_THROW(workers_.RunNext(), Crashed);
    during_match_ = [](const std::stop_token&) { return absl::OkStatus(); };
    Crash();
  }

  JobEnvironment environment_;
  JobLimits limits_;
  FakeJournal journal_;
  std::vector<absl::Status> errors_;
  absl::Time now_ = absl::UnixEpoch();
  std::int64_t budget_bytes_ = kBudget;
  std::map<std::string, std::string> all_blobs_;
  int inputs_ = 0;
  std::vector<std::unique_ptr<MemoryBlobStore>> blobs_after_;
  std::vector<std::unique_ptr<MemoryBudget>> budgets_;
  std::unique_ptr<MemoryJobStore> durable_jobs_;
};

TEST_F(JobRecoveryTest, AcceptedJobsRunAfterACrashInTheirOrder) {
  const std::string first = CreateWithInput();
  const std::string second = CreateWithInput();
  const std::string third = CreateWithInput();
  Crash();
  EXPECT_EQ(manager_->load().queued_jobs, 2);  // the first has its worker
  EXPECT_EQ(manager_->Get(caller_, third)->queue_position, 1);
  history_.clear();
  while (workers_.RunNext()) {
  }
  for (const auto& id : {first, second, third}) {
    EXPECT_EQ(StateOf(id), "SUCCEEDED");
    EXPECT_EQ(manager_->Get(caller_, id)->record.attempt, 1);
  }
  EXPECT_LT(manager_->Get(caller_, first)->record.sequence,
            manager_->Get(caller_, third)->record.sequence);
}

TEST_F(JobRecoveryTest, AJobThatRanIsTriedAgain) {
  const std::string id = CreateWithInput();
  CrashInMatch();
  EXPECT_EQ(StateOf(id), "QUEUED");
  EXPECT_EQ(manager_->Get(caller_, id)->record.progress.total_fraction, 0);
  EXPECT_TRUE(workers_.RunNext());
  EXPECT_EQ(StateOf(id), "SUCCEEDED");
  EXPECT_EQ(manager_->Get(caller_, id)->record.attempt, 2);
}

TEST_F(JobRecoveryTest, AJobThatTheServerGoesDownWithIsGivenUpInTheEnd) {
  const std::string id = CreateWithInput();
  const std::string other = CreateWithInput();
  for (int i = 0; i < limits_.max_attempts; ++i) CrashInMatch();
  EXPECT_EQ(FailureOf(id), "CRASHED_REPEATEDLY");
  EXPECT_TRUE(workers_.RunNext());
  EXPECT_EQ(StateOf(other), "SUCCEEDED");
}

TEST_F(JobRecoveryTest, ResultsAreThereAfterACrashAndStayPinned) {
  const std::string id = CreateWithInput();
  EXPECT_TRUE(workers_.RunNext());
  const auto before = manager_->GetPart(caller_, id, ResultPart::kMap);
  ASSERT_THAT(before, IsOk());
  all_blobs_[before->part.sha256] = *before->bytes;
  Crash();
  const auto after = manager_->GetPart(caller_, id, ResultPart::kMap);
  ASSERT_THAT(after, IsOk());
  EXPECT_EQ(*after->bytes, *before->bytes);
  EXPECT_FALSE(
      environment_.blobs
          ->Put({"", "x"}, std::string(kBlobBytes, 'x'), Keep::kWhileRoom)
          .ok());
}

TEST_F(JobRecoveryTest, ALostResultIsSaidToBeLost) {
  const std::string id = CreateWithInput();
  EXPECT_TRUE(workers_.RunNext());
  Crash();  // and the disk forgot the result
  EXPECT_EQ(ReasonOf(manager_->GetPart(caller_, id, ResultPart::kMap).status()),
            "CONTENT_LOST");
}

TEST_F(JobRecoveryTest, ACancelledJobStaysCancelled) {
  const std::string running = CreateWithInput();
  const std::string queued = CreateWithInput();
  ASSERT_THAT(manager_->Cancel(caller_, queued), IsOk());
  Crash();
  EXPECT_EQ(StateOf(queued), "CANCELLED");
  EXPECT_EQ(StateOf(running), "QUEUED");
}

TEST_F(JobRecoveryTest, TheQueueTimeoutCountsFromTheCreation) {
  Create();  // keeps the worker
  JobSpec spec = Needing(1);
  spec.queue_timeout = absl::Seconds(60);
  const std::string id = Create(spec);
  now_ += absl::Seconds(50);
  Crash();
  timers_.Advance(absl::Seconds(9));
  EXPECT_EQ(StateOf(id), "QUEUED");
  timers_.Advance(absl::Seconds(2));
  EXPECT_EQ(FailureOf(id), "QUEUE_TIMEOUT");
}

TEST_F(JobRecoveryTest, AJobThatStartedInTimeRunsAgainHoweverLate) {
  JobSpec spec = Needing(1);
  spec.queue_timeout = absl::Seconds(60);
  const std::string id = Create(spec);
  now_ += absl::Seconds(70);
  CrashInMatch();
  timers_.Advance(absl::Seconds(1));
  EXPECT_EQ(StateOf(id), "QUEUED");
  EXPECT_TRUE(workers_.RunNext());
  EXPECT_EQ(StateOf(id), "SUCCEEDED");
}

TEST_F(JobRecoveryTest, WhatFitsNoLongerFails) {
  const std::string id = CreateWithInput(kBudget);
  budget_bytes_ = kBudget - 1;
  Crash();
  EXPECT_EQ(FailureOf(id), "JOB_NEEDS_MORE_MEMORY_THAN_BUDGET");
}

TEST_F(JobRecoveryTest, RequestIdsAreRememberedAcrossACrash) {
  JobSpec spec = Needing(1);
  spec.request_id = "r";
  const std::string id = Create(spec);
  Crash();
  EXPECT_EQ(Create(spec), id);
}

TEST_F(JobRecoveryTest, WatchersSequencesNeverFallBack) {
  const std::string id = CreateWithInput();
  std::uint64_t seen = 0;
  during_match_ = [&](const std::stop_token&) {  // after its progress
    seen = manager_->Get(caller_, id)->record.sequence;
    return absl::AbortedError("crash");
  };
  const auto before = journal_.kept;
  EXPECT_TRUE(workers_.RunNext());
  journal_.kept = before;
  Crash();
  EXPECT_GT(seen, 0);
  EXPECT_TRUE(workers_.RunNext());
  EXPECT_GT(manager_->Get(caller_, id)->record.sequence, seen);
}

TEST_F(JobRecoveryTest, AStoppingServerLeavesItsJobsForTheNext) {
  std::atomic<bool> started = false;
  during_match_ = [&](const std::stop_token& stop) -> absl::Status {
    started = true;
    while (!stop.stop_requested()) std::this_thread::yield();
    return absl::CancelledError("cancelled");
  };
  const std::string running = CreateWithInput();
  const std::string queued = CreateWithInput();
  std::thread worker([&] { workers_.RunNext(); });
  while (!started) std::this_thread::yield();
  EXPECT_FALSE(manager_->has_stopped());
  manager_->Shutdown(absl::Milliseconds(20));
  worker.join();
  EXPECT_TRUE(manager_->has_stopped());
  EXPECT_EQ(StateOf(running), "QUEUED");
  EXPECT_EQ(StateOf(queued), "QUEUED");
  EXPECT_EQ(manager_->load().running_jobs, 0);
  during_match_ = [](const std::stop_token&) { return absl::OkStatus(); };
  Crash();
  while (workers_.RunNext()) {
  }
  EXPECT_EQ(StateOf(running), "SUCCEEDED");
  EXPECT_EQ(StateOf(queued), "SUCCEEDED");
  EXPECT_EQ(manager_->Get(caller_, running)->record.attempt, 1);
}

TEST_F(JobRecoveryTest, AJobThatCannotBeSavedIsRefused) {
  journal_.failure = absl::ResourceExhaustedError("disk full");
  const absl::Status refused = manager_->Create(caller_, Needing(1)).status();
  EXPECT_EQ(ReasonOf(refused), "STORAGE_FAILED");
  EXPECT_THAT(refused, StatusIs(absl::StatusCode::kResourceExhausted,
                                HasSubstr("disk full")));
  EXPECT_EQ(manager_->load().queued_jobs, 0);
  EXPECT_FALSE(workers_.RunNext());
}

TEST_F(JobRecoveryTest, WhatCouldNotBeSavedIsSavedLater) {
  const std::string id = CreateWithInput();
  journal_.failure = absl::UnavailableError("no disk");
  EXPECT_TRUE(workers_.RunNext());
  EXPECT_EQ(StateOf(id), "SUCCEEDED");
  EXPECT_EQ(journal_.kept.at(id).state, JobState::kQueued);
  EXPECT_EQ(errors_.size(), 2);  // to run, to succeed
  EXPECT_EQ(ReasonOf(manager_->Delete(caller_, id)), "STORAGE_FAILED");
  journal_.failure = absl::OkStatus();
  CreateWithInput();
  EXPECT_EQ(journal_.kept.at(id).state, JobState::kSucceeded);
}

TEST_F(JobRecoveryTest, OldJobsAreForgottenByThemselves) {
  limits_.job_retention = absl::Hours(1);
  Crash();
  const std::string old = CreateWithInput();
  EXPECT_TRUE(workers_.RunNext());
  now_ += absl::Minutes(50);
  const std::string newer = CreateWithInput();
  EXPECT_TRUE(workers_.RunNext());
  EXPECT_EQ(StateOf(old), "SUCCEEDED");
  now_ += absl::Minutes(11);
  timers_.Advance(absl::Minutes(1));
  EXPECT_EQ(StateOf(old), "GONE");
  EXPECT_EQ(StateOf(newer), "SUCCEEDED");
  EXPECT_THAT(journal_.Records(), testing::SizeIs(1));
  now_ += absl::Hours(1);
  timers_.Advance(absl::Minutes(1));
  EXPECT_EQ(StateOf(newer), "GONE");
}

TEST_F(JobRecoveryTest, WhatCouldNotBeSavedIsSavedAtTheLatestWhenItStops) {
  const std::string id = CreateWithInput();
  journal_.failure = absl::UnavailableError("no disk");
  EXPECT_TRUE(workers_.RunNext());
  journal_.failure = absl::OkStatus();
  manager_->Shutdown(absl::ZeroDuration());
  EXPECT_EQ(journal_.kept.at(id).state, JobState::kSucceeded);
}

TEST_F(JobRecoveryTest, NothingStartsOnceItStops) {
  CreateWithInput();
  const std::string second = CreateWithInput();
  manager_->BeginDrain();
  EXPECT_TRUE(workers_.RunNext());
  EXPECT_FALSE(workers_.RunNext());
  EXPECT_EQ(StateOf(second), "QUEUED");
}

TEST_F(JobRecoveryTest, AJobThatHasItsWorkerButDoesNotRunYetIsStoppedToo) {
  const std::string id = CreateWithInput();  // its task waits in workers_
  std::thread stopping([&] { manager_->Shutdown(absl::ZeroDuration()); });
  absl::SleepFor(absl::Milliseconds(50));  // it has tried to stop the job
  during_match_ = [](const std::stop_token& stop) -> absl::Status {
    while (!stop.stop_requested()) std::this_thread::yield();
    return absl::CancelledError("cancelled");
  };
  EXPECT_TRUE(workers_.RunNext());
  stopping.join();
  EXPECT_EQ(StateOf(id), "QUEUED");
}

TEST_F(JobRecoveryTest, AllBlobsArePinnedBeforeJobsAreForgotten) {
  // The result of the first is the only job kept; its content is the second's
  // input as well.
  const std::string first = CreateWithInput();
  EXPECT_TRUE(workers_.RunNext());
  const auto part = manager_->GetPart(caller_, first, ResultPart::kMap);
  ASSERT_THAT(part, IsOk());
  all_blobs_[part->part.sha256] = *part->bytes;
  JobSpec spec = Needing(1);
  spec.inputs = {{part->part.sha256, *part->bytes}};
  Create(spec);
  limits_.job_retention = absl::ZeroDuration();
  now_ += absl::Hours(1);
  Crash();
  EXPECT_EQ(StateOf(first), "GONE");
  EXPECT_FALSE(environment_.blobs
                   ->Put({"", "x"}, std::string(kBlobBytes, 'x'),
                         Keep::kWhileRoom)
                   .ok());  // the second's input stays
}

TEST_F(JobRecoveryTest, TheMostUrgentStartsFirstAfterACrashToo) {
  Create();
  Create();
  JobSpec urgent = Needing(1);
  urgent.priority = 5;
  const std::string id = Create(urgent);
  Crash();
  EXPECT_TRUE(workers_.RunNext());
  EXPECT_EQ(StateOf(id), "SUCCEEDED");
}

}  // namespace
}  // namespace isomatch
