#include <chrono>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/time/clock.h"
#include "tests/server/test_server.h"

namespace isomatch {
namespace {

class WatchJobTest : public TestServer {};

TEST_F(WatchJobTest, SequencesGrowAndTheLastMessageIsTerminal) {
  gate_open_ = false;
  const std::string name = CreateJob();
  WaitForMatches(1);
  grpc::ClientContext context;
  v1::WatchJobRequest request;
  request.set_name(name);
  const auto reader = stub_->WatchJob(&context, request);
  v1::WatchJobResponse response;
  ASSERT_TRUE(reader->Read(&response));  // at once, though nothing changes
  EXPECT_EQ(response.job().state(), v1::Job::STATE_RUNNING);
  EXPECT_EQ(response.job().progress().stage(), v1::STAGE_GEODESICS);
  std::uint64_t sequence = response.job().sequence();
  gate_open_ = true;
  while (reader->Read(&response)) {
    EXPECT_GT(response.job().sequence(), sequence);
    sequence = response.job().sequence();
  }
  EXPECT_EQ(response.job().state(), v1::Job::STATE_SUCCEEDED);
  EXPECT_TRUE(reader->Finish().ok());
}

TEST_F(WatchJobTest, ALateWatcherGetsTheTerminalJobAtOnce) {
  const std::string name = CreateJob();
  const v1::Job last = Watch(name).back();
  const std::vector<v1::Job> late = Watch(name);
  ASSERT_EQ(late.size(), 1);
  EXPECT_EQ(late[0].sequence(), last.sequence());
  // Also when it has seen that already: the last message is always terminal.
  const absl::Time begin = absl::Now();
  EXPECT_EQ(Watch(name, last.sequence()).size(), 1);
  EXPECT_LT(absl::Now() - begin, absl::Seconds(5));  // not with a heartbeat
}

TEST_F(WatchJobTest, AfterSequenceSkipsWhatWasSeen) {
  gate_open_ = false;
  const std::string name = CreateJob();
  WaitForMatches(1);
  const std::uint64_t seen = GetJob(name).sequence();
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() +
                       std::chrono::milliseconds(100));
  v1::WatchJobRequest request;
  request.set_name(name);
  request.set_after_sequence(seen);
  const auto reader = stub_->WatchJob(&context, request);
  v1::WatchJobResponse response;
  EXPECT_FALSE(reader->Read(&response));
  EXPECT_EQ(reader->Finish().error_code(), grpc::StatusCode::DEADLINE_EXCEEDED);
  gate_open_ = true;
  const std::vector<v1::Job> rest = Watch(name, seen);
  EXPECT_GT(rest.front().sequence(), seen);
  EXPECT_EQ(rest.back().state(), v1::Job::STATE_SUCCEEDED);
}

TEST_F(WatchJobTest, AHeartbeatComesThoughNothingChanges) {
  gate_open_ = false;
  ServerConfig config = TestConfig();
  config.watch_heartbeat = absl::Milliseconds(20);
  Restart(config);
  const std::string name = CreateJob();
  WaitForMatches(1);
  grpc::ClientContext context;
  v1::WatchJobRequest request;
  request.set_name(name);
  const auto reader = stub_->WatchJob(&context, request);
  v1::WatchJobResponse response;
  for (int i = 0; i < 4; ++i) ASSERT_TRUE(reader->Read(&response));
  context.TryCancel();
  EXPECT_EQ(reader->Finish().error_code(), grpc::StatusCode::CANCELLED);
}

TEST_F(WatchJobTest, WatchersThatVanishHoldNothingUp) {
  gate_open_ = false;
  const std::string name = CreateJob();
  v1::WatchJobRequest request;
  request.set_name(name);
  for (int i = 0; i < 50; ++i) {
    grpc::ClientContext context;
    const auto reader = stub_->WatchJob(&context, request);
    context.TryCancel();
    reader->Finish();
  }
  gate_open_ = true;
  EXPECT_EQ(Watch(name).back().state(), v1::Job::STATE_SUCCEEDED);
}

TEST_F(WatchJobTest, AShutdownEndsTheWatchWithTheCancelledJob) {
  gate_open_ = false;
  const std::string name = CreateJob();
  WaitForMatches(1);
  grpc::ClientContext context;
  v1::WatchJobRequest request;
  request.set_name(name);
  const auto reader = stub_->WatchJob(&context, request);
  v1::WatchJobResponse response;
  ASSERT_TRUE(reader->Read(&response));
  server_->Shutdown(absl::Milliseconds(10));
  while (reader->Read(&response)) {
  }
  EXPECT_EQ(response.job().state(), v1::Job::STATE_CANCELLED);
  EXPECT_TRUE(reader->Finish().ok());
}

TEST_F(WatchJobTest, AJobThatWantsItIsCancelledWhenItsWatcherVanishes) {
  gate_open_ = false;
  ServerConfig config = TestConfig();
  config.unwatched_grace = absl::Seconds(1);  // to watch it within
  Restart(config);
  v1::CreateJobRequest create = SphereJob();
  const std::string kept = CreateJob(create);
  WaitForMatches(1);
  create.set_disconnect_policy(v1::DISCONNECT_POLICY_CANCEL);
  v1::WatchJobRequest watch;
  watch.set_name(CreateJob(create));
  grpc::ClientContext context;
  const auto reader = stub_->WatchJob(&context, watch);
  v1::WatchJobResponse response;
  ASSERT_TRUE(reader->Read(&response));
  absl::SleepFor(absl::Milliseconds(1200));
  EXPECT_EQ(GetJob(watch.name()).state(), v1::Job::STATE_QUEUED);
  context.TryCancel();
  reader->Finish();
  while (GetJob(watch.name()).state() != v1::Job::STATE_CANCELLED) {
    absl::SleepFor(absl::Milliseconds(1));
  }
  EXPECT_EQ(GetJob(kept).state(), v1::Job::STATE_RUNNING);
}

TEST_F(WatchJobTest, AnUnknownJobIsNotFound) {
  grpc::ClientContext context;
  v1::WatchJobRequest request;
  request.set_name("jobs/nobody");
  const auto reader = stub_->WatchJob(&context, request);
  v1::WatchJobResponse response;
  EXPECT_FALSE(reader->Read(&response));
  EXPECT_EQ(ErrorOf(reader->Finish()).reason, "JOB_NOT_FOUND");
}

}  // namespace
}  // namespace isomatch
