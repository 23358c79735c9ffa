// Many jobs, few workers, little memory: who starts when.

#include <algorithm>
#include <cstdint>
#include <map>
#include <memory>
#include <random>
#include <set>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "core/base/mutex.h"
#include "core/base/sha256.h"
#include "tests/server/test_server.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

using testing::UnorderedElementsAre;

constexpr int kJobs = 50;
constexpr int kWorkers = 2;
/// Of the memory budget; a job needs some of them, and its meshes.
constexpr int kUnits = 3;
constexpr std::int64_t kUnitBytes = std::int64_t{1} << 20;
constexpr std::int64_t kRoomForMeshes = std::int64_t{1} << 16;

/// What a test asks for.
struct Asked {
  std::string tenant = "a";
  int priority = 0;
  int units = 1;
};

/// Jobs are numbered from 0 as they are created; each runs until the test lets
/// it end. Tenants are a, b and c; everything is looked at by an administrator.
class QueueingTest : public TestServer {
 protected:
  QueueingTest() {
    ServerConfig config = TestConfig();
    config.workers = kWorkers;
    config.memory_budget_bytes = kUnits * kUnitBytes + kRoomForMeshes;
    config.prepared_cache_bytes = 0;  // all of it is for jobs
    std::string keys =
        absl::StrCat("admin all admin ", Sha256Hex("admin"), "\n");
    for (const char* tenant : {"a", "b", "c"}) {
      absl::StrAppend(&keys, tenant, " ", tenant, " submit ", Sha256Hex(tenant),
                      " max-priority=100\n");
    }
    config.api_keys = folder_.Write("keys", keys);
    Restart(config, HeldEngine());
  }
  ~QueueingTest() override {
    EndAll();
    server_->Shutdown(absl::ZeroDuration());
  }

  /// A method that tells jobs apart by their random seed, and keeps count of
  /// what runs by itself.
  MatchEngine HeldEngine() {
    MatchEngine engine = GatedEngine();
    engine.estimate = [this](auto, auto, auto, const MatchOptions& options) {
      MutexLock lock(mutex_);
      return asked_[options.random_seed].units * kUnitBytes;
    };
    engine.match = [this](auto&&, auto&&, auto&&, const MatchOptions& options,
                          auto&&) -> absl::StatusOr<Correspondence> {
      const auto number = static_cast<int>(options.random_seed);
      MutexLock lock(mutex_);
      started_.push_back(number);
      used_units_ += asked_[options.random_seed].units;
      most_used_units_ = std::max(most_used_units_, used_units_);
      changed_.NotifyAll();
      while (!all_may_end_ && may_end_.count(number) == 0) {
        changed_.Wait(mutex_);
      }
      used_units_ -= asked_[options.random_seed].units;
      Correspondence found;
      found.y_from_x = {0};
      return found;
    };
    return engine;
  }

  void Create(const Asked& asked) {
    v1::CreateJobRequest request = SphereJob();
    {
      MutexLock lock(mutex_);
      request.mutable_options()->set_random_seed(asked_.size());
      asked_.push_back(asked);
    }
    request.set_priority(asked.priority);
    grpc::ClientContext context;
    context.AddMetadata("api-key", asked.tenant);
    v1::CreateJobResponse response;
    const grpc::Status status = stub_->CreateJob(&context, request, &response);
    EXPECT_TRUE(status.ok()) << status.error_message();
    EXPECT_GE(response.job().memory_estimate_bytes(),
              static_cast<std::uint64_t>(asked.units * kUnitBytes));
  }

  /// What the server says; what is reserved has to fit.
  v1::GetServerInfoResponse Info() {
    grpc::ClientContext context;
    context.AddMetadata("api-key", "admin");
    v1::GetServerInfoResponse info;
    EXPECT_TRUE(stub_->GetServerInfo(&context, {}, &info).ok());
    EXPECT_LE(info.memory_reserved_bytes(), info.memory_budget_bytes());
    EXPECT_LE(info.running_jobs(), static_cast<std::uint32_t>(kWorkers));
    return info;
  }

  /// Waits until so many run, asking again and again.
  void WaitUntilRunning(std::uint32_t count) {
    while (Info().running_jobs() != count) {
      absl::SleepFor(absl::Milliseconds(1));
    }
  }

  /// Waits until `count` jobs have started in all; returns their numbers.
  std::vector<int> Started(size_t count) {
    MutexLock lock(mutex_);
    while (started_.size() < count) changed_.Wait(mutex_);
    return started_;
  }

  void End(int number) {
    MutexLock lock(mutex_);
    may_end_.insert(number);
    changed_.NotifyAll();
  }

  void EndAll() {
    MutexLock lock(mutex_);
    all_may_end_ = true;
    changed_.NotifyAll();
  }

  int most_used_units() const {
    MutexLock lock(mutex_);
    return most_used_units_;
  }

  int CountSucceeded() {
    grpc::ClientContext context;
    context.AddMetadata("api-key", "admin");
    v1::ListJobsRequest request;
    request.add_states(v1::Job::STATE_SUCCEEDED);
    v1::ListJobsResponse response;
    EXPECT_TRUE(stub_->ListJobs(&context, request, &response).ok());
    return response.jobs_size();
  }

  TemporaryFolder folder_;
  mutable Mutex mutex_;
  CondVar changed_;
  std::vector<Asked> asked_ ABSL_GUARDED_BY(mutex_);
  std::vector<int> started_ ABSL_GUARDED_BY(mutex_);
  std::set<int> may_end_ ABSL_GUARDED_BY(mutex_);
  bool all_may_end_ ABSL_GUARDED_BY(mutex_) = false;
  int used_units_ ABSL_GUARDED_BY(mutex_) = 0;
  int most_used_units_ ABSL_GUARDED_BY(mutex_) = 0;
};

/// The rule, said once more and slowly.
class Rule {
 public:
  explicit Rule(const std::vector<Asked>& asked) : asked_(asked) {}

  /// Which of the `waiting` starts next when the `running` run.
  int Next(const std::set<int>& waiting, const std::set<int>& running) const {
    const std::vector<int> next = NextOfTenants(waiting);
    return *std::min_element(next.begin(), next.end(), [&](int a, int b) {
      return Rank(a, running) < Rank(b, running);
    });
  }

  /// It starts, the `waiting` do not.
  void Start(int job, const std::set<int>& waiting) {
    for (const int other : NextOfTenants(waiting)) {
      if (!IsRisen(job) && asked_[other].priority < asked_[job].priority) {
        ++overtakes_[asked_[other].tenant];
      }
    }
    overtakes_[asked_[job].tenant] = 0;
    last_served_[asked_[job].tenant] = ++starts_;
  }

 private:
  bool IsRisen(int job) const {
    const auto found = overtakes_.find(asked_[job].tenant);
    return found != overtakes_.end() && found->second >= 8;
  }

  /// The smallest goes first.
  std::vector<int> Rank(int job, const std::set<int>& running) const {
    const std::string& tenant = asked_[job].tenant;
    const auto runs = std::count_if(
        running.begin(), running.end(),
        [&](int other) { return asked_[other].tenant == tenant; });
    const auto served = last_served_.find(tenant);
    const bool is_risen = IsRisen(job);
    return {is_risen ? 0 : 1, is_risen ? 0 : -asked_[job].priority,
            static_cast<int>(runs),
            served == last_served_.end() ? 0 : served->second, job};
  }

  std::vector<int> NextOfTenants(const std::set<int>& waiting) const {
    std::map<std::string, int> next;
    for (const int job : waiting) {
      const auto [found, is_first] = next.emplace(asked_[job].tenant, job);
      if (is_first || asked_[job].priority > asked_[found->second].priority) {
        found->second = job;
      }
    }
    std::vector<int> jobs;
    for (const auto& [tenant, job] : next) jobs.push_back(job);
    return jobs;
  }

  const std::vector<Asked>& asked_;
  int starts_ = 0;
  std::map<std::string, int> last_served_;
  std::map<std::string, int> overtakes_;
};

TEST_F(QueueingTest, FiftyJobsStartByPriorityThenInTurnsThenByAge) {
  std::mt19937_64 random(3);
  std::vector<Asked> asked;
  Rule rule(asked);
  std::set<int> waiting;
  for (int job = 0; job < kJobs; ++job) {
    // Most are of tenant a, which must not keep the others waiting.
    const char* const tenants[] = {"a", "a", "a", "b", "c"};
    asked.push_back(
        {tenants[random() % 5], static_cast<int>(random() % 3) * 10 - 10});
    Create(asked.back());
    if (job < kWorkers) {
      Started(job + 1);
      rule.Start(job, {});
    } else {
      waiting.insert(job);
    }
  }
  EXPECT_EQ(Info().queued_jobs(), kJobs - kWorkers);
  std::set<int> running = {0, 1};
  for (int ended = 0; ended + kWorkers < kJobs; ++ended) {
    const std::vector<int> started = Started(ended + kWorkers);
    running.erase(started[ended]);
    const int next = rule.Next(waiting, running);
    End(started[ended]);
    ASSERT_EQ(Started(ended + kWorkers + 1).back(), next)
        << "after " << ended + 1 << " have ended";
    waiting.erase(next);
    rule.Start(next, waiting);
    running.insert(next);
    Info();
  }
  EndAll();
  WaitUntilRunning(0);
  EXPECT_EQ(CountSucceeded(), kJobs);
}

TEST_F(QueueingTest, FiftyJobsOfAllSizesNeverHoldMoreThanTheBudget) {
  std::mt19937_64 random(4);
  for (int job = 0; job < kJobs; ++job) {
    Create({"a", 0, 1 + static_cast<int>(random() % kUnits)});
  }
  std::uint64_t most_reserved = 0;
  for (int ended = 0; ended < kJobs; ++ended) {
    const int number = Started(ended + 1)[ended];
    most_reserved = std::max(most_reserved, Info().memory_reserved_bytes());
    End(number);
    Info();
  }
  WaitUntilRunning(0);
  EXPECT_EQ(CountSucceeded(), kJobs);
  EXPECT_EQ(most_used_units(), kUnits);  // all of it was put to use
  EXPECT_GE(most_reserved, static_cast<std::uint64_t>(kUnits * kUnitBytes));
  EXPECT_EQ(Info().memory_reserved_bytes(), 0);
}

TEST_F(QueueingTest, SmallJobsPassALargeOneEightTimes) {
  constexpr int kPasses = 8;
  Create({});  // runs all the time, so that the large one does not fit
  Started(1);
  Create({.units = kUnits});
  const int large = 1;
  for (int small = 0; small <= kPasses; ++small) Create({});
  for (int passed = 1; passed <= kPasses; ++passed) {
    ASSERT_EQ(Started(1 + passed).back(), large + passed);
    End(large + passed);
  }
  WaitUntilRunning(1);
  Create({});  // it would fit, and the creation looks for what can start
  ASSERT_EQ(Info().running_jobs(), 1);
  End(0);
  ASSERT_EQ(Started(kPasses + 2).back(), large);
  WaitUntilRunning(1);  // beside it nothing fits
  EndAll();
  // Two workers take the last two: either may be the first to say so.
  const std::vector<int> started = Started(kPasses + 4);
  EXPECT_THAT(std::vector<int>(started.end() - 2, started.end()),
              UnorderedElementsAre(large + kPasses + 1, large + kPasses + 2));
  WaitUntilRunning(0);
  EXPECT_EQ(CountSucceeded(), kPasses + 4);
}

}  // namespace
}  // namespace isomatch
