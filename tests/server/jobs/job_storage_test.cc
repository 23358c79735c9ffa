#include <memory>
#include <string>
#include <vector>

#include "server/storage/sha256.h"

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

  void Begin(const JobManager::Limits& limits = {}) {
    JobManager::Parts parts = MakeParts();
    parts.load_spec =
        [this](const JobRecord& record) -> absl::StatusOr<JobSpec> {
      if (!inputs_.ok() && record.labels.count("any") == 0) {
        return ContentUnavailable("request", inputs_);
      }
      return Needing(static_cast<int>(record.memory_estimate_bytes));
    };
    parts.on_storage = [this](const absl::Status& storage) {
      told_.push_back(std::string(storage.message()));
    };
    parts.retention_clock = clock_.get();
    parts.now = [this] { return now_; };
    manager_ = std::make_unique<JobManager>(limits, parts);
  }

  void FillDisk() { blobs_.disk = absl::ResourceExhaustedError("disk full"); }

  JobSnapshot Snapshot(const std::string& id) {
    return *manager_->Get(caller_, id);
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
  EXPECT_TRUE(AllRoomIsFree());
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

TEST_F(JobStorageTest, AJobWhoseInputsCannotBeReadNowWaitsAndIsPassed) {
  const std::string id = Create();
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

TEST_F(JobStorageTest, AJobThatWaitsForItsInputsCanBeCancelled) {
  const std::string id = Create();
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

TEST_F(JobStorageTest, NoJobIsForgottenByAClockThatIsNotBelieved) {
  now_ += absl::Hours(24 * 8);
  clock_ = std::make_unique<RetentionClock>(
      RetentionClock::Parts{.now = [this] { return now_; },
                            .steady = [this] { return steady_; },
                            .save = [](absl::Time) {},
                            .on_change = [](bool, const std::string&) {}},
      absl::UnixEpoch());
  now_ -= absl::Hours(24 * 8);
  Begin({.job_retention = absl::Hours(24 * 7)});
  const std::string id = Create();
  EXPECT_TRUE(workers_.RunNext());
  manager_->Begin();
  now_ += absl::Hours(24 * 8);
  timers_.Advance(absl::Minutes(1));
  EXPECT_EQ(StateOf(id), "SUCCEEDED");
  steady_ += RetentionClock::kGrace;
  now_ += RetentionClock::kGrace;
  timers_.Advance(absl::Minutes(1));
  EXPECT_EQ(StateOf(id), "GONE");
}

TEST(StorageGateTest, TriesLessAndLessOften) {
  ManualExecutor timers;
  std::vector<std::int64_t> tried;
  std::vector<std::string> told;
  absl::Status disk = absl::ResourceExhaustedError("full");
  StorageGate gate({.timers = &timers,
                    .probe =
                        [&](std::int64_t bytes) {
                          tried.push_back(bytes);
                          return disk;
                        },
                    .on_change =
                        [&](const absl::Status& status) {
                          told.push_back(std::string(status.message()));
                        }});
  EXPECT_TRUE(gate.is_open());
  gate.Close(10, disk);
  gate.Close(20, disk);
  gate.Close(15, disk);
  EXPECT_FALSE(gate.is_open());
  for (int i = 0; i < 63; ++i) timers.Advance(absl::Seconds(1));
  // After 1, 3, 7, 15, 31, 61 s.
  EXPECT_THAT(tried, ElementsAre(20, 20, 20, 20, 20, 20));
  EXPECT_THAT(told, ElementsAre("full"));
  disk = absl::OkStatus();
  timers.Advance(StorageGate::kLongestPause);
  EXPECT_TRUE(gate.is_open());
  EXPECT_THAT(told, ElementsAre("full", ""));
  timers.Advance(absl::Hours(1));
  EXPECT_THAT(tried, SizeIs(7));
}

}  // namespace
}  // namespace isomatch
