#pragma once

#include <atomic>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"
#include "server/jobs/errors.h"
#include "server/jobs/job_manager.h"
#include "server/storage/memory_blob_store.h"
#include "server/storage/memory_job_store.h"
#include "tests/server/manual_executor.h"
#include "tests/support/matchers.h"
#include "tests/support/unprepared_engine.h"

namespace isomatch {

inline std::string ReasonOf(const absl::Status& status) {
  return status.ok() ? "OK" : DetailsOf(status).reason;
}

/// Lets something happen just before a request is looked up, or a job changes.
class JobStoreWithHook : public MemoryJobStore {
 public:
  absl::StatusOr<JobRecord> FindByRequestId(
      const std::string& tenant, const std::string& request_id) const override {
    if (before_find) before_find();
    return MemoryJobStore::FindByRequestId(tenant, request_id);
  }

  absl::StatusOr<JobRecord> Update(JobRecord record) override {
    if (before_update) before_update(record);
    return MemoryJobStore::Update(std::move(record));
  }

  std::function<void()> before_find;
  std::function<void(const JobRecord&)> before_update;
};

/// Lets something happen just before a blob is put, and refuses as a disk may.
class BlobStoreWithHook : public MemoryBlobStore {
 public:
  using MemoryBlobStore::MemoryBlobStore;

  absl::Status Put(const BlobKey& key, std::string bytes, Keep keep) override {
    if (before_put) before_put();
    if (!disk.ok()) return disk;
    if (static_cast<std::int64_t>(bytes.size()) > room_bytes) {
      return absl::ResourceExhaustedError("too large");
    }
    return MemoryBlobStore::Put(key, std::move(bytes), keep);
  }

  absl::StatusOr<Blob> Get(const BlobKey& key) override {
    if (!reading.ok()) return reading;
    return MemoryBlobStore::Get(key);
  }

  absl::Status TryWriting(std::int64_t bytes) override {
    if (bytes > room_bytes) return absl::ResourceExhaustedError("too large");
    return disk;
  }

  std::function<void()> before_put;
  absl::Status disk;
  /// Of the disk, for one blob.
  std::int64_t room_bytes = std::numeric_limits<std::int64_t>::max();
  absl::Status reading;
};

/// A manager whose jobs run when the test says so. A job needs as many bytes as
/// it has landmarks; `during_match` is what it does while it runs.
class JobManagerTest : public testing::Test {
 protected:
  JobManagerTest() { Restart({}); }

  void Restart(const JobLimits& limits) {
    manager_ = std::make_unique<JobManager>(MakeEnvironment(limits));
  }

  JobEnvironment MakeEnvironment(const JobLimits& limits = {}) {
    JobEnvironment environment;
    environment.limits = limits;
    environment.jobs = &jobs_;
    environment.blobs = &blobs_;
    environment.budget = &budget_;
    environment.runner = &runner_;
    environment.workers = &workers_;
    environment.timers = &timers_;
    environment.now = [] { return absl::UnixEpoch(); };
    environment.new_id = [this] { return absl::StrCat("job", ++last_id_); };
    environment.load_spec = [](const JobRecord& record) {
      return Needing(static_cast<int>(record.memory_estimate_bytes));
    };
    environment.on_state = [this](const JobRecord& record) {
      if (before_state_) before_state_(record);
      history_.push_back(JobStateName(record.state));
    };
    return environment;
  }

  MatchEngine FakeEngine() {
    MatchEngine engine = UnpreparedEngine();
    engine.match =
        [this](auto&&, auto&&, auto&&, auto&&,
               const MatchControl& control) -> absl::StatusOr<Correspondence> {
      control.progress({Stage::kGeodesics, 0.5, 0.25});
      hurry_ = control.hurry;
      const absl::Status status = during_match_(control.stop);
      if (!status.ok()) return status;
      Correspondence found = found_;
      found.y_from_x = {static_cast<VertexIndex>(++matches_)};
      return found;
    };
    engine.estimate = [](auto&&, auto&&, std::int64_t landmarks, auto&&) {
      return landmarks;
    };
    return engine;
  }

  /// What matches find beside the map, which is another one for each.
  static Correspondence AllParts() {
    Correspondence found;
    found.precise.resize(1);
    found.confidence = {0.5f};
    found.alternatives.push_back({{77}, {}});
    found.functional_map.setOnes(1, 1);
    found.eigenvalues_x.setZero(1);
    found.eigenvalues_y.setZero(1);
    return found;
  }

  /// True when nothing is pinned: a blob of all the room evicts everything.
  bool AllRoomIsFree() {
    return blobs_.Put({"", "x"}, std::string(kBlobBytes, 'x'), Keep::kWhileRoom)
        .ok();
  }

  static JobSpec Needing(int bytes) {
    JobSpec spec;
    spec.landmarks.resize(static_cast<size_t>(bytes));
    return spec;
  }

  std::string Create(JobSpec spec = Needing(1)) {
    const auto snapshot = manager_->Create(caller_, std::move(spec));
    EXPECT_THAT(snapshot, IsOk());
    return snapshot.ok() ? snapshot->record.id : "";
  }

  std::string StateOf(const std::string& id) {
    const auto snapshot = manager_->Get(caller_, id);
    return snapshot.ok() ? JobStateName(snapshot->record.state) : "GONE";
  }

  std::string FailureOf(const std::string& id) {
    const auto snapshot = manager_->Get(caller_, id);
    return snapshot.ok() && snapshot->record.error
               ? snapshot->record.error->reason
               : "none";
  }

  /// Everybody, while nothing is about tenants.
  const Caller caller_;
  static constexpr std::int64_t kBudget = 1000;
  static constexpr size_t kBlobBytes = 1 << 20;

  std::atomic<int> last_id_ = 0;
  int matches_ = 0;
  std::stop_token hurry_;  ///< of the match that runs, or ran last
  Correspondence found_;
  std::vector<std::string> history_;
  std::function<void(const JobRecord&)> before_state_;
  std::function<absl::Status(std::stop_token)> during_match_ =
      [](const std::stop_token&) { return absl::OkStatus(); };
  JobStoreWithHook jobs_;
  BlobStoreWithHook blobs_{kBlobBytes};
  MemoryBudget budget_{kBudget};
  PreparedCache no_cache_{0, nullptr};
  JobRunner runner_{FakeEngine(), [](auto&&...) { return std::string(); },
                    absl::Now, no_cache_};
  ManualExecutor workers_;
  ManualExecutor timers_;
  std::unique_ptr<JobManager> manager_;
};

}  // namespace isomatch
