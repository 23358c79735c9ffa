#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/base/sha256.h"

#include "tests/server/jobs/job_manager_fixture.h"

namespace isomatch {
namespace {

using testing::_;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::SizeIs;

/// A manager whose disk refuses when the test says so.
class JobStorageTest : public JobManagerTest {
 protected:
  JobStorageTest() { Begin(); }

  void Begin(const JobLimits& limits = {}) {
    JobEnvironment environment = MakeEnvironment(limits);
    environment.load_spec =
        [this](const JobRecord& record) -> absl::StatusOr<JobSpec> {
      if (!inputs_.ok() && record.labels.count("any") == 0) {
        return ContentUnavailable("request", inputs_);
      }
      return Needing(static_cast<int>(record.memory_estimate_bytes));
    };
    environment.on_storage = [this](const absl::Status& storage) {
      told_.push_back(std::string(storage.message()));
    };
    environment.retention_clock = clock_.get();
    environment.now = [this] { return now_; };
    environment.uptime = [this] { return steady_; };
    manager_ = std::make_unique<JobManager>(environment);
  }

  /// A clock that last saw this.
  void SetClock(std::optional<absl::Time> last_seen) {
    clock_ = std::make_unique<RetentionClock>(
        RetentionClock::Environment{
            .now = [this] { return now_; },
            .steady = [this] { return steady_; },
            .save = [](absl::Time) {},
            .on_change = [](bool, const std::string&) {}},
        last_seen);
  }

  void Pass(absl::Duration time) {
    now_ += time;
    steady_ += time;
    timers_.Advance(time);
  }

  void FillDisk() { blobs_.disk = absl::ResourceExhaustedError("disk full"); }

  JobSnapshot Snapshot(const std::string& id) {
    return *manager_->Get(caller_, id);
  }

  /// A job that waited behind another, and is loaded when it starts.
  std::string CreateThatIsLoaded() {
    Create();
    const std::string id = Create();
    EXPECT_TRUE(workers_.RunNext());
    return id;
  }

  /// A job with a request, which is its own, and these meshes.
  std::string CreateWith(const std::vector<std::string>& meshes) {
    JobSpec spec = Needing(1);
    const std::string request = absl::StrCat("request ", last_id_.load());
    spec.inputs = {{Sha256Hex(request), request}};
    for (const std::string& mesh : meshes) {
      spec.inputs.push_back({Sha256Hex(mesh), mesh});
    }
    return Create(spec);
  }

  bool IsStored(const std::string& bytes) {
    return blobs_.Has({caller_.tenant, Sha256Hex(bytes)});
  }

  absl::Status inputs_;
  std::vector<std::string> told_;
  absl::Time now_ = absl::UnixEpoch();
  absl::Duration steady_;
  std::unique_ptr<RetentionClock> clock_;
};

TEST_F(JobStorageTest, AJobWhoseResultTheDiskRefusesWaitsAndAllOthersToo) {
  const std::string first = Create();
  const std::string second = Create();
  FillDisk();
  EXPECT_TRUE(workers_.RunNext());
  EXPECT_FALSE(workers_.RunNext());
  for (const std::string& id : {first, second}) {
    EXPECT_EQ(StateOf(id), "QUEUED");
    EXPECT_EQ(Snapshot(id).waiting_for, WaitReason::kStorage);
    EXPECT_EQ(Snapshot(id).record.attempt, 0);
  }
  EXPECT_FALSE(manager_->load().can_store);
  EXPECT_EQ(manager_->load().queued_jobs, 2);
  EXPECT_EQ(manager_->load().running_jobs, 0);
  timers_.Advance(StorageGate::kFirstProbe);
  EXPECT_FALSE(workers_.RunNext());
  EXPECT_THAT(told_, ElementsAre(HasSubstr("disk full")));
  blobs_.disk = absl::OkStatus();
  timers_.Advance(2 * StorageGate::kFirstProbe);
  EXPECT_THAT(told_, ElementsAre(_, ""));
  EXPECT_TRUE(manager_->load().can_store);
  while (workers_.RunNext()) {
  }
  for (const std::string& id : {first, second}) {
    EXPECT_EQ(StateOf(id), "SUCCEEDED");
    EXPECT_EQ(Snapshot(id).record.attempt, 1);
    EXPECT_EQ(Snapshot(id).waiting_for, WaitReason::kTurn);
  }
  EXPECT_TRUE(manager_->GetPart(caller_, first, ResultPart::kMap).ok());
}

TEST_F(JobStorageTest, NewJobsAreTakenInOrRefusedAsTheDiskSays) {
  Create();
  FillDisk();
  EXPECT_TRUE(workers_.RunNext());
  JobSpec spec = Needing(1);
  spec.inputs = {{Sha256Hex("x"), "x"}};
  EXPECT_EQ(ReasonOf(manager_->Create(caller_, spec).status()),
            "STORAGE_FAILED");
  EXPECT_EQ(manager_->load().queued_jobs, 1);
}

TEST_F(JobStorageTest, NothingOfAResultThatWaitsIsKept) {
  found_ = AllParts();
  const std::string id = Create();
  int puts = 0;
  blobs_.before_put = [&] {
    if (++puts == 3) FillDisk();
  };
  EXPECT_TRUE(workers_.RunNext());
  EXPECT_EQ(StateOf(id), "QUEUED");
  blobs_.disk = absl::OkStatus();
  blobs_.before_put = nullptr;
  EXPECT_EQ(blobs_.size_bytes(), 0);
  EXPECT_TRUE(AllRoomIsFree());
}

TEST_F(JobStorageTest, OneResultThatIsTooLargeHoldsUpNoOther) {
  found_ = AllParts();
  const std::string large = Create();
  blobs_.room_bytes = 3;
  EXPECT_TRUE(workers_.RunNext());
  EXPECT_EQ(Snapshot(large).waiting_for, WaitReason::kStorage);
  EXPECT_EQ(manager_->load().held_for_storage, 1);
  EXPECT_EQ(manager_->load().held_jobs, 0);
  EXPECT_TRUE(manager_->load().can_store);
  EXPECT_THAT(told_, testing::IsEmpty());
  found_ = {};
  blobs_.room_bytes = 10;  // enough for a map alone
  const std::string small = Create();
  EXPECT_TRUE(workers_.RunNext());
  EXPECT_EQ(StateOf(small), "SUCCEEDED");
  for (int i = 0; i < 20; ++i) Pass(absl::Seconds(30));
  EXPECT_FALSE(workers_.RunNext());  // it does not run to find out
  found_ = AllParts();
  blobs_.room_bytes = 10000;
  Pass(absl::Seconds(30));
  EXPECT_EQ(manager_->load().held_for_storage, 0);
  EXPECT_TRUE(workers_.RunNext());
  EXPECT_EQ(StateOf(large), "SUCCEEDED");
  EXPECT_EQ(Snapshot(large).record.attempt, 1);
}

TEST_F(JobStorageTest, OneThatWaitsForRoomCanBeCancelled) {
  const std::string id = Create();
  blobs_.room_bytes = 3;
  EXPECT_TRUE(workers_.RunNext());
  EXPECT_THAT(manager_->Cancel(caller_, id), IsOk());
  EXPECT_EQ(manager_->load().held_for_storage, 0);
  blobs_.room_bytes = 10000;
  Pass(absl::Minutes(1));
  EXPECT_FALSE(workers_.RunNext());
  EXPECT_EQ(StateOf(id), "CANCELLED");
}

TEST_F(JobStorageTest, WhatWaitsForTheDiskRunsBesideTheTimers) {
  ManualExecutor disk;
  JobEnvironment environment = MakeEnvironment();
  environment.disk = &disk;
  manager_ = std::make_unique<JobManager>(environment);
  const std::string id = Create();
  FillDisk();
  EXPECT_TRUE(workers_.RunNext());
  blobs_.disk = absl::OkStatus();
  timers_.Advance(StorageGate::kFirstProbe);
  EXPECT_FALSE(manager_->load().can_store);
  EXPECT_TRUE(disk.RunNext());
  EXPECT_TRUE(manager_->load().can_store);
  timers_.Advance(StorageGate::kLongestPause);
  while (disk.RunNext()) {
  }
  EXPECT_TRUE(workers_.RunNext());
  EXPECT_EQ(StateOf(id), "SUCCEEDED");
  manager_->Shutdown(absl::ZeroDuration());
  timers_.Advance(absl::Hours(1));
  EXPECT_FALSE(disk.RunNext());
}

TEST_F(JobStorageTest, AfterAStartOnAFullDiskNoJobRunsToFindOut) {
  const std::string id = Create();
  FillDisk();
  workers_.Clear();  // the process ends
  Begin({.durable = true});
  manager_->Begin();
  EXPECT_FALSE(workers_.RunNext());
  EXPECT_EQ(Snapshot(id).waiting_for, WaitReason::kStorage);
  blobs_.disk = absl::OkStatus();
  Pass(StorageGate::kFirstProbe);
  EXPECT_TRUE(workers_.RunNext());
  EXPECT_EQ(StateOf(id), "SUCCEEDED");
}

TEST_F(JobStorageTest, KeptResultsGiveWayToAJob) {
  const std::string kept = Create();
  const std::string last = Create();
  EXPECT_TRUE(workers_.RunNext());
  EXPECT_TRUE(workers_.RunNext());
  const std::int64_t result_bytes = blobs_.size_bytes() / 2;
  const auto rest = static_cast<std::int64_t>(kBlobBytes) - blobs_.size_bytes();
  ASSERT_THAT(blobs_.Put({"", "y"}, std::string(static_cast<size_t>(rest), 'y'),
                         Keep::kPinned),
              IsOk());
  const std::string id = Create();
  EXPECT_TRUE(workers_.RunNext());
  EXPECT_EQ(StateOf(id), "SUCCEEDED");
  EXPECT_EQ(StateOf(kept), "GONE");
  EXPECT_EQ(StateOf(last), "SUCCEEDED");
  EXPECT_EQ(blobs_.size_bytes(), rest + 2 * result_bytes);
}

TEST_F(JobStorageTest, WhereJobsNeedAllTheRoomOneGivesWay) {
  ASSERT_THAT(
      blobs_.Put({"", "y"}, std::string(kBlobBytes, 'y'), Keep::kPinned),
      IsOk());
  const std::string id = Create();
  EXPECT_TRUE(workers_.RunNext());
  EXPECT_EQ(FailureOf(id), "STORAGE_FAILED");
  EXPECT_TRUE(manager_->load().can_store);
}

TEST_F(JobStorageTest, AJobThatWaitsForTheDiskCanBeCancelled) {
  const std::string id = Create();
  FillDisk();
  EXPECT_TRUE(workers_.RunNext());
  EXPECT_THAT(manager_->Cancel(caller_, id), IsOk());
  EXPECT_EQ(StateOf(id), "CANCELLED");
  EXPECT_EQ(manager_->load().queued_jobs, 0);
  blobs_.disk = absl::OkStatus();
  timers_.Advance(StorageGate::kFirstProbe);
  EXPECT_FALSE(workers_.RunNext());
}

TEST_F(JobStorageTest, AStoppingServerDoesNotTryTheDiskAnyMore) {
  const std::string id = Create();
  FillDisk();
  EXPECT_TRUE(workers_.RunNext());
  manager_->Shutdown(absl::ZeroDuration());
  EXPECT_EQ(StateOf(id), "CANCELLED");
  blobs_.disk = absl::OkStatus();
  timers_.Advance(StorageGate::kLongestPause);
  EXPECT_THAT(told_, SizeIs(1));
}

TEST_F(JobStorageTest, AJobThatStartsAtOnceIsNotLoadedAgain) {
  std::vector<std::string> loaded;
  JobEnvironment environment = MakeEnvironment();
  environment.load_spec = [&](const JobRecord& record) {
    loaded.push_back(record.id);
    return Needing(1);
  };
  manager_ = std::make_unique<JobManager>(environment);
  const std::string first = Create();
  const std::string second = Create();
  while (workers_.RunNext()) {
  }
  EXPECT_EQ(StateOf(first), "SUCCEEDED");
  EXPECT_EQ(StateOf(second), "SUCCEEDED");
  EXPECT_THAT(loaded, ElementsAre(second));
}

TEST_F(JobStorageTest, AJobWhoseInputsCannotBeReadNowWaitsAndIsPassed) {
  const std::string id = CreateThatIsLoaded();
  JobSpec other = Needing(1);
  other.labels = {{"any", ""}};
  inputs_ = absl::UnavailableError("too many open files");
  EXPECT_TRUE(workers_.RunNext());
  EXPECT_EQ(StateOf(id), "QUEUED");
  EXPECT_EQ(Snapshot(id).waiting_for, WaitReason::kInputs);
  EXPECT_EQ(Snapshot(id).record.attempt, 0);
  EXPECT_EQ(manager_->load().held_jobs, 1);
  EXPECT_FALSE(workers_.RunNext());
  const std::string passing = Create(other);
  EXPECT_TRUE(workers_.RunNext());
  EXPECT_EQ(StateOf(passing), "SUCCEEDED");
  // Twice as long each time.
  timers_.Advance(absl::Seconds(1));
  EXPECT_TRUE(workers_.RunNext());
  timers_.Advance(absl::Seconds(1));
  EXPECT_FALSE(workers_.RunNext());
  inputs_ = absl::OkStatus();
  timers_.Advance(absl::Seconds(1));
  EXPECT_EQ(manager_->load().held_jobs, 0);
  EXPECT_TRUE(workers_.RunNext());
  EXPECT_EQ(StateOf(id), "SUCCEEDED");
  EXPECT_EQ(Snapshot(id).record.attempt, 1);
}

TEST_F(JobStorageTest, InputsThatCannotBeReadForAnHourAreLost) {
  const std::string id = CreateThatIsLoaded();
  inputs_ = absl::UnavailableError("permission denied");
  absl::Duration waited;
  while (StateOf(id) == "QUEUED" && waited < absl::Hours(3)) {
    (void)workers_.RunNext();
    Pass(absl::Seconds(30));
    waited += absl::Seconds(30);
  }
  EXPECT_EQ(FailureOf(id), "CONTENT_LOST");
  EXPECT_GE(waited, absl::Minutes(55));
  EXPECT_LE(waited, absl::Minutes(65));
  EXPECT_EQ(manager_->load().queued_jobs, 0);
}

TEST_F(JobStorageTest, AJobThatWaitsForItsInputsCanBeCancelled) {
  const std::string id = CreateThatIsLoaded();
  inputs_ = absl::UnavailableError("too many open files");
  EXPECT_TRUE(workers_.RunNext());
  EXPECT_THAT(manager_->Cancel(caller_, id), IsOk());
  timers_.Advance(absl::Minutes(1));
  EXPECT_FALSE(workers_.RunNext());
  EXPECT_EQ(manager_->load().held_jobs, 0);
  EXPECT_EQ(StateOf(id), "CANCELLED");
}

TEST_F(JobStorageTest, APartThatCannotBeReadNowIsNotLost) {
  const std::string id = Create();
  EXPECT_TRUE(workers_.RunNext());
  blobs_.reading = absl::UnavailableError("too many open files");
  const absl::Status status =
      manager_->GetPart(caller_, id, ResultPart::kMap).status();
  EXPECT_EQ(ReasonOf(status), "CONTENT_UNAVAILABLE");
  EXPECT_TRUE(absl::IsUnavailable(status));
  EXPECT_TRUE(DetailsOf(status).retry_after.has_value());
  blobs_.reading = absl::OkStatus();
  EXPECT_THAT(manager_->GetPart(caller_, id, ResultPart::kMap), IsOk());
}

TEST_F(JobStorageTest, ADeletedJobGivesItsBytesBackAtOnce) {
  const std::string first = CreateWith({"template", "x"});
  const std::string second = CreateWith({"template", "y"});
  EXPECT_TRUE(workers_.RunNext());
  EXPECT_TRUE(workers_.RunNext());
  EXPECT_THAT(manager_->Delete(caller_, first), IsOk());
  EXPECT_FALSE(IsStored("x"));
  EXPECT_FALSE(IsStored("request 0"));
  EXPECT_TRUE(IsStored("template"));  // the second names it
  EXPECT_TRUE(IsStored("y"));
  EXPECT_TRUE(manager_->GetPart(caller_, second, ResultPart::kMap).ok());
  EXPECT_THAT(manager_->Delete(caller_, second), IsOk());
  EXPECT_EQ(blobs_.size_bytes(), 0);
}

TEST_F(JobStorageTest, WhatAnotherJobNeedsIsNotRemoved) {
  const std::string first = CreateWith({"x"});
  EXPECT_TRUE(workers_.RunNext());
  // A job without a record of its own yet has pinned it.
  EXPECT_TRUE(blobs_.Pin({caller_.tenant, Sha256Hex("x")}));
  EXPECT_THAT(manager_->Delete(caller_, first), IsOk());
  EXPECT_TRUE(IsStored("x"));
}

TEST_F(JobStorageTest, AForgottenJobLeavesItsMeshesForOthers) {
  Begin({.max_kept_jobs = 1});
  CreateWith({"x"});
  const std::string second = CreateWith({"x"});
  EXPECT_TRUE(workers_.RunNext());
  EXPECT_TRUE(workers_.RunNext());
  EXPECT_FALSE(IsStored("request 0"));
  EXPECT_TRUE(IsStored("x"));
  EXPECT_EQ(StateOf(second), "SUCCEEDED");
}

constexpr absl::Duration kWeek = absl::Hours(24 * 7);

TEST_F(JobStorageTest, NoJobIsForgottenByAClockThatIsNotBelieved) {
  const std::string id = Create();
  EXPECT_TRUE(workers_.RunNext());
  SetClock(now_);
  Begin({.job_retention = kWeek, .durable = true});
  manager_->Begin();
  now_ += absl::Hours(24 * 8);
  Pass(absl::Minutes(1));
  EXPECT_EQ(StateOf(id), "SUCCEEDED");
  Pass(kWeek);  // by the steady clock too
  EXPECT_EQ(StateOf(id), "GONE");
}

TEST_F(JobStorageTest, AJobThatEndedAtAWrongTimeIsAsOldAsTheProcessSaw) {
  SetClock(std::nullopt);  // in 1970, at the first start
  Begin({.job_retention = kWeek});
  manager_->Begin();
  const std::string id = Create();
  EXPECT_TRUE(workers_.RunNext());
  now_ += absl::Hours(24 * 365 * 56);  // put right
  Pass(absl::Minutes(1));
  Pass(RetentionClock::kGrace);
  Pass(absl::Minutes(1));
  EXPECT_EQ(StateOf(id), "SUCCEEDED");
  Pass(kWeek - RetentionClock::kGrace);
  EXPECT_EQ(StateOf(id), "GONE");
}

TEST_F(JobStorageTest, AJobThatEndedWhileTheClockWasBehindIsNoOlderForThat) {
  SetClock(now_);
  Begin({.job_retention = kWeek});
  manager_->Begin();
  now_ -= 4 * kWeek;
  const std::string id = Create();
  EXPECT_TRUE(workers_.RunNext());
  now_ += 4 * kWeek;  // put right
  workers_.Clear();
  timers_.Clear();
  steady_ += 2 * kWeek;  // another process: it says nothing of the last one's
  SetClock(now_);
  Begin({.job_retention = kWeek, .durable = true});
  manager_->Begin();
  EXPECT_EQ(StateOf(id), "SUCCEEDED");
  Pass(kWeek);
  EXPECT_EQ(StateOf(id), "SUCCEEDED");
  Pass(absl::Minutes(1));
  EXPECT_EQ(StateOf(id), "GONE");
}

TEST_F(JobStorageTest, AQueueTimeoutGoesByTheTimeThatIsBelieved) {
  JobSpec spec = Needing(1);
  spec.queue_timeout = absl::Hours(2);
  const std::string id = Create(spec);
  workers_.Clear();
  timers_.Clear();
  now_ += absl::Hours(24 * 8);  // a wrong clock at the start
  SetClock(now_ - absl::Hours(24 * 8));
  Begin({.durable = true});
  manager_->Begin();
  Pass(absl::Hours(1));
  EXPECT_EQ(StateOf(id), "QUEUED");
  Pass(absl::Hours(1));
  EXPECT_EQ(FailureOf(id), "QUEUE_TIMEOUT");
}

}  // namespace
}  // namespace isomatch
