// What one tenant can do to another. Alice does harm, Bob has a job or two.

#include <atomic>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "core/base/mutex.h"
#include "core/base/sha256.h"
#include "tests/server/test_server.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

using testing::ElementsAre;

/// Jobs are told apart by their random seed. Those of kSlow stay in the intake
/// until `intake_open_`.
class FairnessTest : public TestServer {
 protected:
  static constexpr std::uint64_t kSlow = 99;

  FairnessTest() { Start(TestConfig()); }
  ~FairnessTest() override {
    intake_open_ = true;
    gate_open_ = true;
    server_->Shutdown(absl::ZeroDuration());
  }

  void Start(ServerConfig config) {
    config.api_keys = folder_.Write("keys", KeysOf({"alice", "bob"}));
    MatchEngine engine = GatedEngine();
    engine.estimate = [this](auto, auto, auto, const MatchOptions& options) {
      if (options.random_seed == kSlow) is_reading_ = true;
      while (options.random_seed == kSlow && !intake_open_) {
        absl::SleepFor(absl::Milliseconds(1));
      }
      return std::int64_t{1} << 20;
    };
    engine.match = [this, match = engine.match](
                       auto&& x, auto&& y, auto&& landmarks,
                       const MatchOptions& options, auto&& control) {
      {
        MutexLock lock(mutex_);
        started_.push_back(static_cast<int>(options.random_seed));
      }
      return match(x, y, landmarks, options, control);
    };
    Restart(config, engine);
  }

  static std::unique_ptr<grpc::ClientContext> As(const std::string& key) {
    auto context = std::make_unique<grpc::ClientContext>();
    context->AddMetadata("api-key", key);
    return context;
  }

  v1::CreateJobRequest Job(int seed, int priority = 0) {
    v1::CreateJobRequest request = SphereJob();
    request.mutable_options()->set_random_seed(seed);
    request.set_priority(priority);
    return request;
  }

  grpc::Status Create(const std::string& key,
                      const v1::CreateJobRequest& request,
                      v1::Job* job = nullptr) {
    v1::CreateJobResponse response;
    const grpc::Status status =
        stub_->CreateJob(As(key).get(), request, &response);
    if (job != nullptr) *job = response.job();
    return status;
  }

  v1::Job WaitForEnd(const std::string& key, const std::string& name) {
    v1::WatchJobRequest request;
    request.set_name(name);
    const auto context = As(key);
    const auto reader = stub_->WatchJob(context.get(), request);
    v1::WatchJobResponse last;
    while (reader->Read(&last)) {
    }
    return last.job();
  }

  int Position(const std::string& key, const std::string& name) {
    v1::GetJobRequest request;
    request.set_name(name);
    v1::GetJobResponse response;
    EXPECT_TRUE(stub_->GetJob(As(key).get(), request, &response).ok());
    return static_cast<int>(response.job().queue_position());
  }

  v1::GetServerInfoResponse::Limits Limits(const std::string& key) {
    v1::GetServerInfoResponse response;
    EXPECT_TRUE(stub_->GetServerInfo(As(key).get(), {}, &response).ok());
    return response.limits();
  }

  std::vector<int> started() {
    MutexLock lock(mutex_);
    return started_;
  }

  TemporaryFolder folder_;
  std::atomic<bool> intake_open_ = false;
  std::atomic<bool> is_reading_ = false;
  Mutex mutex_;
  std::vector<int> started_ ABSL_GUARDED_BY(mutex_);
};

TEST_F(FairnessTest, CancelledJobsOfOthersPushOutNoResult) {
  ServerConfig config = TestConfig();
  config.max_kept_jobs = 10;
  Start(config);
  v1::CreateJobRequest request = Job(0);
  request.set_request_id("retried");
  v1::Job job;
  ASSERT_TRUE(Create("bob", request, &job).ok());
  EXPECT_EQ(WaitForEnd("bob", job.name()).state(), v1::Job::STATE_SUCCEEDED);
  gate_open_ = false;
  for (int i = 0; i < 40; ++i) {
    v1::Job other;
    ASSERT_TRUE(Create("alice", Job(i), &other).ok());
    v1::CancelJobRequest cancel;
    cancel.set_name(other.name());
    v1::CancelJobResponse cancelled;
    EXPECT_TRUE(stub_->CancelJob(As("alice").get(), cancel, &cancelled).ok());
  }
  gate_open_ = true;
  // Neither do results.
  for (int i = 0; i < 20; ++i) {
    v1::Job other;
    ASSERT_TRUE(Create("alice", Job(i), &other).ok());
    WaitForEnd("alice", other.name());
  }
  v1::Job again;
  ASSERT_TRUE(Create("bob", request, &again).ok());
  EXPECT_EQ(again.name(), job.name());
  EXPECT_EQ(again.state(), v1::Job::STATE_SUCCEEDED);
}

TEST_F(FairnessTest, SlowRequestsDelayNobodyElse) {
  ServerConfig config = TestConfig();
  config.max_requests_per_tenant = 5;
  Start(config);
  v1::CreateJobRequest slow = Job(kSlow);
  slow.set_validate_only(true);
  std::atomic<int> refused = 0;
  std::jthread first([&] { EXPECT_TRUE(Create("alice", slow).ok()); });
  while (!is_reading_) absl::SleepFor(absl::Milliseconds(1));
  std::vector<std::jthread> calls;
  for (int i = 0; i < 20; ++i) {
    calls.emplace_back([&] {
      const grpc::Status status = Create("alice", slow);
      if (status.ok()) return;
      const CallError error = ErrorOf(status);
      EXPECT_EQ(error.reason, "TENANT_QUOTA");
      EXPECT_TRUE(error.has_retry);
      ++refused;
    });
  }
  // Beside the one that is read five wait.
  while (refused < 15) absl::SleepFor(absl::Milliseconds(1));
  EXPECT_TRUE(Create("bob", Job(1)).ok());
  intake_open_ = true;
  calls.clear();
  EXPECT_EQ(refused, 15);
}

TEST_F(FairnessTest, ATenantHasHalfOfTheQueue) {
  ServerConfig config = TestConfig();
  config.max_queued_jobs = 10;
  Start(config);
  gate_open_ = false;
  ASSERT_TRUE(Create("alice", Job(0)).ok());
  WaitForMatches(1);
  for (int i = 0; i < 5; ++i) ASSERT_TRUE(Create("alice", Job(i)).ok());
  const CallError error = ErrorOf(Create("alice", Job(5)));
  EXPECT_EQ(error.reason, "TENANT_QUOTA");
  EXPECT_TRUE(error.has_retry);
  EXPECT_TRUE(Create("bob", Job(6)).ok());
}

TEST_F(FairnessTest, OneWorkerIsSharedAndPositionsAreTrue) {
  gate_open_ = false;
  ASSERT_TRUE(Create("alice", Job(0)).ok());
  WaitForMatches(1);
  for (int i = 1; i <= 3; ++i) {
    ASSERT_TRUE(Create("alice", Job(i, /*priority=*/100)).ok());
  }
  std::vector<v1::Job> bobs(2);
  for (int i = 0; i < 2; ++i) {
    ASSERT_TRUE(Create("bob", Job(10 + i), &bobs[i]).ok());
  }
  EXPECT_EQ(Position("bob", bobs[0].name()), 0);
  EXPECT_EQ(Position("bob", bobs[1].name()), 2);
  gate_open_ = true;
  WaitForMatches(6);
  EXPECT_THAT(started(), ElementsAre(0, 10, 1, 11, 2, 3));
}

/// An upload that is never finished.
class OpenUpload {
 public:
  OpenUpload(v1::CorrespondenceService::Stub& stub,
             std::unique_ptr<grpc::ClientContext> context,
             const std::string& sha256, std::uint64_t size_bytes)
      : context_(std::move(context)),
        writer_(stub.UploadMesh(context_.get(), &response_)) {
    v1::UploadMeshRequest request;
    request.mutable_header()->set_sha256(sha256);
    request.mutable_header()->set_size_bytes(size_bytes);
    writer_->Write(request);
  }
  ~OpenUpload() {
    context_->TryCancel();
    writer_->Finish();
  }

 private:
  std::unique_ptr<grpc::ClientContext> context_;
  v1::UploadMeshResponse response_;
  std::unique_ptr<grpc::ClientWriter<v1::UploadMeshRequest>> writer_;
};

TEST_F(FairnessTest, UploadsOfOneTenantLeaveRoomForOthers) {
  ServerConfig config = TestConfig();
  config.max_uploads_per_tenant = 3;
  Start(config);
  const std::uint64_t most = Limits("alice").max_mesh_bytes();
  std::vector<std::unique_ptr<OpenUpload>> open;
  for (const char digit : {'a', 'b', 'c'}) {
    open.push_back(std::make_unique<OpenUpload>(*stub_, As("alice"),
                                                std::string(64, digit), most));
  }
  const std::string mesh(3000, 'x');
  const auto upload = [&](const std::string& key) {
    v1::UploadMeshResponse response;
    const auto context = As(key);
    const auto writer = stub_->UploadMesh(context.get(), &response);
    v1::UploadMeshRequest request;
    request.mutable_header()->set_sha256(Sha256Hex(mesh));
    request.mutable_header()->set_size_bytes(mesh.size());
    writer->Write(request);
    request.set_chunk(mesh);
    writer->Write(request);
    writer->WritesDone();
    return writer->Finish();
  };
  grpc::Status fourth = upload("alice");
  while (fourth.ok()) {  // until all three have begun
    absl::SleepFor(absl::Milliseconds(1));
    fourth = upload("alice");
  }
  EXPECT_EQ(ErrorOf(fourth).reason, "UPLOAD_QUOTA");
  EXPECT_TRUE(ErrorOf(fourth).has_retry);
  EXPECT_TRUE(upload("bob").ok());
}

/// Calls a method with bytes that our own messages cannot make.
grpc::Status CallWith(const std::shared_ptr<grpc::Channel>& channel,
                      grpc::ClientContext& context, const std::string& method,
                      const std::string& bytes) {
  grpc::GenericStub stub(channel);
  const grpc::Slice slice(bytes);
  const grpc::ByteBuffer request(&slice, 1);
  grpc::CompletionQueue queue;
  const auto call = stub.PrepareUnaryCall(
      &context, "/isomatch.v1.CorrespondenceService/" + method, request,
      &queue);
  call->StartCall();
  grpc::ByteBuffer response;
  grpc::Status status;
  call->Finish(&response, &status, nullptr);
  void* tag = nullptr;
  bool ok = false;
  queue.Next(&tag, &ok);
  return status;
}

TEST_F(FairnessTest, RequestsOfManyEmptyMessagesAreRefusedUnparsed) {
  std::string landmarks;
  for (int i = 0; i < 2'000'000; ++i) landmarks += std::string("\x1a\x00", 2);
  const CallError create =
      ErrorOf(CallWith(channel_, *As("alice"), "CreateJob", landmarks));
  EXPECT_EQ(create.code, grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(create.reason, "INVALID_FIELD");
  EXPECT_EQ(create.field, "landmarks");
  std::string digests;
  for (int i = 0; i < 10'000; ++i) digests += std::string("\x0a\x00", 2);
  const CallError find =
      ErrorOf(CallWith(channel_, *As("alice"), "FindMissingMeshes", digests));
  EXPECT_EQ(find.reason, "INVALID_FIELD");
  EXPECT_EQ(find.field, "digests");
  EXPECT_EQ(ErrorOf(CallWith(channel_, *As("bob"), "CreateJob", "\xff")).field,
            "request");
}

TEST_F(FairnessTest, EachTenantIsToldItsLimits) {
  ServerConfig config = TestConfig();
  config.max_queued_jobs = 30;
  config.max_uploads_per_tenant = 7;
  config.max_priority = 4;
  Start(config);
  const v1::GetServerInfoResponse::Limits limits = Limits("bob");
  EXPECT_EQ(limits.max_queued_jobs_per_tenant(), 15);
  EXPECT_EQ(limits.max_running_jobs_per_tenant(), 1);
  EXPECT_GT(limits.max_bytes_per_tenant(), 0);
  EXPECT_EQ(limits.max_kept_jobs_per_tenant(), 500);
  EXPECT_EQ(limits.max_uploads_per_tenant(), 7);
  EXPECT_GE(limits.max_upload_bytes_per_tenant(), limits.max_mesh_bytes());
  EXPECT_EQ(limits.max_requests_per_tenant(), 32);
  EXPECT_EQ(limits.max_priority(), 4);
}

}  // namespace
}  // namespace isomatch
