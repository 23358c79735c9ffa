// Gateways and workers within the test's process, on a real PostgreSQL: what
// one process says, and what another hears.

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/time/clock.h"
#include "grpc/health/v1/health.grpc.pb.h"
#include "tests/server/cluster_fixture.h"
#include "tests/server/many_calls.h"

namespace isomatch {
namespace {

TEST_F(ClusterTest, AnyGatewayAnswersAnyCall) {
  const auto other = Start(Config("gateway"));
  const auto worker = Start(Config("worker"));
  const std::string name = CreateJob();
  CallAt(*other);
  const std::vector<v1::Job> seen = Watch(name);
  ASSERT_FALSE(seen.empty());
  EXPECT_EQ(seen.back().state(), v1::Job::STATE_SUCCEEDED);
  EXPECT_EQ(seen.back().attempt(), 1);
  grpc::ClientContext context;
  v1::DownloadResultRequest request;
  request.set_name(name);
  const auto reader = stub_->DownloadResult(&context, request);
  v1::DownloadResultResponse response;
  std::string bytes;
  while (reader->Read(&response)) bytes += response.chunk();
  EXPECT_TRUE(reader->Finish().ok());
  EXPECT_FALSE(bytes.empty());
}

TEST_F(ClusterTest, AGatewayRunsNothing) {
  const std::string name = CreateJob();
  absl::SleepFor(absl::Milliseconds(500));
  EXPECT_EQ(GetJob(name).state(), v1::Job::STATE_QUEUED);
  EXPECT_EQ(matches_, 0);
  const auto worker = Start(Config("worker"));
  WaitFor(name, v1::Job::STATE_SUCCEEDED);
}

TEST_F(ClusterTest, TheSameRequestAtTwoGatewaysIsOneJob) {
  const auto other = Start(Config("gateway"));
  v1::CreateJobRequest request = SphereJob();
  request.set_request_id("once");
  const std::string name = CreateJob(request);
  CallAt(*other);
  EXPECT_EQ(CreateJob(request), name);
  request.set_priority(1);
  EXPECT_EQ(CreateError(request).reason, "REQUEST_ID_REUSED");
}

TEST_F(ClusterTest, AWorkerHearsOfACancelAtAGateway) {
  gate_open_ = false;
  const auto worker = Start(Config("worker"));
  const std::string name = CreateJob();
  WaitForMatches(1);
  EXPECT_EQ(Cancel(name).state(), v1::Job::STATE_CANCELLED);
  for (int i = 0; i < 500 && worker->running_jobs() > 0; ++i) {
    absl::SleepFor(absl::Milliseconds(10));
  }
  EXPECT_EQ(worker->running_jobs(), 0);
  EXPECT_EQ(GetJob(name).state(), v1::Job::STATE_CANCELLED);
}

TEST_F(ClusterTest, AWorkerThatStopsGivesItsJobsBackWithoutAnAttempt) {
  gate_open_ = false;
  auto worker = Start(Config("worker"));
  const std::string name = CreateJob();
  WaitForMatches(1);
  worker->Shutdown(absl::ZeroDuration());
  const v1::Job back = GetJob(name);
  EXPECT_EQ(back.state(), v1::Job::STATE_QUEUED);
  EXPECT_EQ(back.attempt(), 0);
  worker.reset();
  gate_open_ = true;
  worker = Start(Config("worker"));
  EXPECT_EQ(WaitFor(name, v1::Job::STATE_SUCCEEDED).attempt(), 1);
}

TEST_F(ClusterTest, TimeoutsOfQueueAndRunHold) {
  v1::CreateJobRequest hasty = SphereJob();
  hasty.mutable_queue_timeout()->set_nanos(50'000'000);
  const std::string waits = CreateJob(hasty);
  EXPECT_EQ(WaitFor(waits, v1::Job::STATE_FAILED).error().reason(),
            "QUEUE_TIMEOUT");
  gate_open_ = false;
  const auto worker = Start(Config("worker"));
  v1::CreateJobRequest brief = SphereJob();
  brief.mutable_run_timeout()->set_nanos(50'000'000);
  const std::string runs = CreateJob(brief);
  EXPECT_EQ(WaitFor(runs, v1::Job::STATE_FAILED).error().reason(),
            "RUN_TIMEOUT");
}

TEST_F(ClusterTest, OnlyAJobThatNobodyWatchesIsCancelledForIt) {
  v1::CreateJobRequest request = SphereJob();
  request.set_disconnect_policy(v1::DISCONNECT_POLICY_CANCEL);
  const std::string watched = CreateJob(request);
  grpc::ClientContext context;
  v1::WatchJobRequest watch;
  watch.set_name(watched);
  const auto reader = stub_->WatchJob(&context, watch);
  v1::WatchJobResponse response;
  ASSERT_TRUE(reader->Read(&response));
  const std::string unwatched = CreateJob(request);
  WaitFor(unwatched, v1::Job::STATE_CANCELLED);
  EXPECT_EQ(GetJob(watched).state(), v1::Job::STATE_QUEUED);
  context.TryCancel();
  (void)reader->Finish();
  WaitFor(watched, v1::Job::STATE_CANCELLED);
}

TEST_F(ClusterTest, TellsWhatAllWorkersHave) {
  ServerConfig config = Config("worker");
  config.workers = 2;
  config.threads_per_job = 3;
  config.memory_budget_bytes = std::int64_t{1} << 30;
  const auto one = Start(config);
  const auto two = Start(config);
  v1::GetServerInfoResponse info = Info();
  for (int i = 0; i < 200 && info.workers() != 4; ++i) {
    absl::SleepFor(absl::Milliseconds(20));
    info = Info();
  }
  EXPECT_EQ(info.workers(), 4);
  EXPECT_EQ(info.threads_per_job(), 3);
  EXPECT_LE(info.memory_budget_bytes(), std::uint64_t{1} << 30);
}

TEST_F(ClusterTest, WithoutWorkersJobsWaitForSomeThatAreNotKnown) {
  const v1::GetServerInfoResponse info = Info();
  EXPECT_EQ(info.workers(), 0);
  EXPECT_EQ(info.memory_budget_bytes(), 0);
  EXPECT_EQ(GetJob(CreateJob()).state(), v1::Job::STATE_QUEUED);
}

TEST_F(ClusterTest, AProcessMayBeBoth) {
  const auto both = Start(Config("all"));
  CallAt(*both);
  const std::string name = CreateJob();
  EXPECT_EQ(Watch(name).back().state(), v1::Job::STATE_SUCCEEDED);
}

TEST_F(ClusterTest, DeletedJobsAreGoneForAll) {
  const auto other = Start(Config("gateway"));
  const auto worker = Start(Config("worker"));
  const std::string name = CreateJob();
  WaitFor(name, v1::Job::STATE_SUCCEEDED);
  EXPECT_TRUE(Delete(name).ok());
  CallAt(*other);
  grpc::ClientContext again;
  v1::GetJobRequest get;
  get.set_name(name);
  v1::GetJobResponse job;
  EXPECT_EQ(stub_->GetJob(&again, get, &job).error_code(),
            grpc::StatusCode::NOT_FOUND);
}

TEST_F(ClusterTest, AWatchEndsEvenIfSequencesHaveFallen) {
  gate_open_ = false;
  const auto worker = Start(Config("worker"));
  const std::string name = CreateJob();
  WaitForMatches(1);
  grpc::ClientContext context;
  v1::WatchJobRequest request;
  request.set_name(name);
  const auto reader = stub_->WatchJob(&context, request);
  v1::WatchJobResponse response;
  ASSERT_TRUE(reader->Read(&response));
  // As before a crash of the database that takes it back.
  Do("UPDATE isomatch.live_jobs SET sequence = sequence + 1000000");
  while (response.job().sequence() < 1000000) {
    ASSERT_TRUE(reader->Read(&response));
  }
  // Not below 1, should the worker have written its own meanwhile.
  Do("UPDATE isomatch.live_jobs "
     "SET sequence = greatest(sequence - 1000000, 1)");
  const absl::Time begin = absl::Now();
  gate_open_ = true;
  while (reader->Read(&response)) {
  }
  EXPECT_TRUE(reader->Finish().ok());
  EXPECT_EQ(response.job().state(), v1::Job::STATE_SUCCEEDED);
  EXPECT_LT(response.job().sequence(), 1000000);
  EXPECT_LT(absl::Now() - begin, absl::Seconds(5));
}

TEST_F(ClusterTest, AProcessThatStartsLateGivesWorkersAWholeLease) {
  const std::string name = CreateJob();
  server_.reset();
  // Its worker could not renew, nor has anybody looked.
  Do("UPDATE isomatch.live_jobs SET state = 2, claim = 1, worker = 'w', "
     "started = now(), lease_until = now() - interval '1 h'");
  Do("DELETE FROM isomatch.chores");
  server_ = Start(Config("gateway"));
  CallAt(*server_);
  absl::SleepFor(absl::Seconds(1));
  EXPECT_EQ(GetJob(name).state(), v1::Job::STATE_RUNNING);
  WaitFor(name, v1::Job::STATE_QUEUED);
}

TEST_F(ClusterTest, CallsThatWaitForTheDatabaseHoldUpNoOthers) {
  const v1::CreateJobRequest request = SphereJob();
  pqxx::connection database((*TheServer())->url());
  pqxx::work lock(database);
  lock.exec("LOCK TABLE isomatch.live_jobs IN ACCESS EXCLUSIVE MODE");
  {
    std::vector<std::jthread> callers;
    for (int i = 0; i < 40; ++i) {
      callers.emplace_back([&] {
        grpc::ClientContext context;
        context.set_deadline(std::chrono::system_clock::now() +
                             std::chrono::seconds(3));
        v1::CreateJobResponse response;
        EXPECT_FALSE(stub_->CreateJob(&context, request, &response).ok());
      });
    }
    absl::SleepFor(absl::Milliseconds(500));
    const auto health = grpc::health::v1::Health::NewStub(channel_);
    for (int i = 0; i < 10; ++i) {
      grpc::ClientContext context;
      context.set_deadline(std::chrono::system_clock::now() +
                           std::chrono::seconds(1));
      grpc::health::v1::HealthCheckResponse response;
      EXPECT_TRUE(health->Check(&context, {}, &response).ok());
    }
  }
  lock.abort();
}

TEST_F(ClusterTest, TooManyCallsThatWaitForTheDatabaseAreRefused) {
  constexpr int kTaken = 512 + 7;  // wait, and run
  constexpr int kRefused = 50;
  const std::string name = CreateJob();
  v1::GetJobRequest request;
  request.set_name(name);
  pqxx::connection database((*TheServer())->url());
  pqxx::work lock(database);
  lock.exec("LOCK TABLE isomatch.jobs IN ACCESS EXCLUSIVE MODE");
  ManyCalls<v1::GetJobRequest, v1::GetJobResponse> calls(
      [&](auto* context, auto* asked, auto* response, auto on_end) {
        stub_->async()->GetJob(context, asked, response, std::move(on_end));
      });
  for (int i = 0; i < kTaken + kRefused; ++i) calls.Begin(request);
  for (const grpc::Status& status : calls.WaitFor(kRefused)) {
    const CallError error = ErrorOf(status);
    EXPECT_EQ(error.code, grpc::StatusCode::RESOURCE_EXHAUSTED);
    EXPECT_EQ(error.reason, "TENANT_QUOTA");
    EXPECT_TRUE(error.has_retry);
  }
  // A watch finds no place either, and goes on when there is one.
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() +
                       std::chrono::seconds(30));
  v1::WatchJobRequest watched;
  watched.set_name(name);
  const auto reader = stub_->WatchJob(&context, watched);
  absl::SleepFor(absl::Milliseconds(500));
  EXPECT_EQ(calls.WaitFor(0).size(), kRefused);
  lock.abort();
  v1::WatchJobResponse response;
  EXPECT_TRUE(reader->Read(&response));
  EXPECT_EQ(response.job().name(), name);
  context.TryCancel();
}

}  // namespace
}  // namespace isomatch
