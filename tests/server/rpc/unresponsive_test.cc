// A method that does not stop when it is asked to.

#include <cstdint>
#include <memory>
#include <string>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/time/clock.h"
#include "core/base/mutex.h"
#include "server/storage/process_trace.h"
#include "tests/server/test_server.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

using testing::HasSubstr;

class UnresponsiveTest : public TestServer {
 protected:
  ~UnresponsiveTest() override {
    may_return_ = true;
    server_.reset();
    Restart(TestConfig());  // for ~TestServer
  }

  /// Jobs of this random seed do not stop before the test's end.
  static constexpr std::uint64_t kDeaf = 7;

  MatchEngine DeafEngine() {
    MatchEngine engine = GatedEngine();
    const auto match = engine.match;
    engine.match = [this, match](
                       auto&& mesh_x, auto&& mesh_y, auto&& landmarks,
                       const MatchOptions& options,
                       auto&& control) -> absl::StatusOr<Correspondence> {
      if (options.random_seed != kDeaf) {
        return match(mesh_x, mesh_y, landmarks, options, control);
      }
      ++matches_;
      while (!may_return_) absl::SleepFor(absl::Milliseconds(1));
      return absl::CancelledError("at last");
    };
    return engine;
  }

  static ServerConfig Impatient() {
    ServerConfig config = TestConfig();
    config.unresponsive_grace = absl::Milliseconds(20);
    return config;
  }

  std::string CreateDeaf() {
    v1::CreateJobRequest request = SphereJob();
    request.mutable_options()->set_random_seed(kDeaf);
    return CreateJob(request);
  }

  void Cancel(const std::string& name) {
    grpc::ClientContext context;
    v1::CancelJobRequest request;
    request.set_name(name);
    v1::CancelJobResponse response;
    EXPECT_TRUE(stub_->CancelJob(&context, request, &response).ok());
  }

  v1::GetServerInfoResponse Info() {
    grpc::ClientContext context;
    v1::GetServerInfoResponse info;
    EXPECT_TRUE(stub_->GetServerInfo(&context, {}, &info).ok());
    return info;
  }

  std::atomic<bool> may_return_ = false;
};

TEST_F(UnresponsiveTest, OthersJobsRunBesideOneThatDoesNotStop) {
  Restart(Impatient(), DeafEngine());
  const std::string deaf = CreateDeaf();
  WaitForMatches(1);
  Cancel(deaf);
  EXPECT_EQ(GetJob(deaf).state(), v1::Job::STATE_CANCELLED);
  // There is one worker.
  EXPECT_EQ(Watch(CreateJob()).back().state(), v1::Job::STATE_SUCCEEDED);
  EXPECT_EQ(server_->stuck_workers(), 1);
  const v1::Job job = GetJob(deaf);
  EXPECT_EQ(job.state(), v1::Job::STATE_CANCELLED);
  EXPECT_TRUE(job.run().unresponsive());
  EXPECT_EQ(job.run().faults(), 1);
}

TEST_F(UnresponsiveTest, TheServersLimitIsToldAndHolds) {
  ServerConfig config = Impatient();
  config.max_run_time = absl::Milliseconds(1500);
  Restart(config, DeafEngine());
  EXPECT_EQ(Info().max_run_time().seconds(), 1);
  EXPECT_EQ(Info().max_run_time().nanos(), 500'000'000);
  v1::CreateJobRequest request = SphereJob();
  request.mutable_options()->set_random_seed(kDeaf);
  request.mutable_run_timeout()->set_seconds(3600);
  const std::string deaf = CreateJob(request);
  EXPECT_EQ(GetJob(deaf).run().timeout().seconds(), 1);
  const v1::Job ended = Watch(deaf).back();
  EXPECT_EQ(ended.error().reason(), "RUN_TIMEOUT");
  EXPECT_THAT(ended.error().message(), HasSubstr("--max-run-time"));
  EXPECT_EQ(Watch(CreateJob()).back().state(), v1::Job::STATE_SUCCEEDED);
}

TEST_F(UnresponsiveTest, AServerThatStopsDoesNotWaitForItAndCountsIt) {
  const TemporaryFolder folder;
  ServerConfig config = Impatient();
  config.data_dir = folder.Path("data");
  Restart(config, DeafEngine());
  const std::string deaf = CreateDeaf();
  WaitForMatches(1);
  server_->Shutdown(absl::ZeroDuration());
  EXPECT_EQ(server_->stuck_workers(), 1);
  may_return_ = true;
  Restart(config, GatedEngine());
  const v1::Job job = Watch(deaf).back();
  EXPECT_EQ(job.state(), v1::Job::STATE_SUCCEEDED);
  EXPECT_EQ(job.run().faults(), 1);
  EXPECT_TRUE(job.run().unresponsive());
}

TEST_F(UnresponsiveTest, TheTraceOfAServerExpectsWhatGrpcMayHave) {
  const TemporaryFolder folder;
  ServerConfig config = TestConfig();
  config.data_dir = folder.Path("data");
  gate_open_ = false;
  Restart(config, GatedEngine());
  CreateJob();
  TraceFile file(folder.Path("data/running.json"));
  ProcessTrace trace;
  do {
    absl::SleepFor(absl::Milliseconds(1));
    trace = file.Read();
  } while (trace.jobs.empty() || trace.jobs[0].attempt == 0);
  // And 256 MiB for the process.
  EXPECT_GE(trace.expected_bytes, std::int64_t{768} << 20);
  EXPECT_GT(trace.jobs[0].resident_at_begin, 0);
  EXPECT_FALSE(trace.jobs[0].is_stuck);
  gate_open_ = true;
  Restart(TestConfig());  // before its folder goes
}

TEST_F(UnresponsiveTest, WhenItTakesAllWorkersTheProcessIsToEnd) {
  const TemporaryFolder folder;
  ServerConfig config = Impatient();
  config.data_dir = folder.Path("data");
  Mutex mutex;
  CondVar told;
  std::string reason;
  server_.reset();
  auto created =
      Server::Create(config, DeafEngine(), [&](const std::string& why) {
        MutexLock lock(mutex);
        reason = why;
        told.NotifyAll();
      });
  ASSERT_TRUE(created.ok()) << created.status();
  server_ = *std::move(created);
  stub_ = v1::CorrespondenceService::NewStub(server_->InProcessChannel());
  const std::string deaf = CreateDeaf();
  WaitForMatches(1);
  Cancel(deaf);
  {
    MutexLock lock(mutex);
    while (reason.empty()) told.Wait(mutex);
    EXPECT_THAT(reason, HasSubstr("all workers"));
  }
  may_return_ = true;
  server_.reset();
}

}  // namespace
}  // namespace isomatch
