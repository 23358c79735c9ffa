// A disk that stands still holds up who needs it, and nobody else.

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <SQLiteCpp/SQLiteCpp.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "core/base/sha256.h"
#include "grpc/health/v1/health.grpc.pb.h"
#include "tests/server/many_calls.h"
#include "tests/server/test_server.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

class StalledDiskTest : public TestServer {
 protected:
  /// More than gRPC has threads for them.
  static constexpr int kCalls = 48;

  StalledDiskTest() {
    ServerConfig config = TestConfig();
    config.api_keys = folder_.Write("keys", KeysOf({"alice", "bob"}));
    config.data_dir = folder_.Path("data");
    config.max_uploads_per_tenant = 2 * kCalls;
    config.max_queued_jobs = 4 * kCalls;
    Restart(config);
  }

  ~StalledDiskTest() override {
    GoOn();
    calls_.clear();
    gate_open_ = true;
    Restart(TestConfig());  // before its folder goes
  }

  static std::unique_ptr<grpc::ClientContext> As(const std::string& key) {
    auto context = std::make_unique<grpc::ClientContext>();
    context->AddMetadata("api-key", key);
    context->set_deadline(absl::ToChronoTime(absl::Now() + absl::Minutes(1)));
    return context;
  }

  std::string Create(const std::string& key) {
    v1::CreateJobResponse response;
    const grpc::Status status =
        stub_->CreateJob(As(key).get(), SphereJob(), &response);
    EXPECT_TRUE(status.ok()) << status.error_message();
    return response.job().name();
  }

  void WaitForEnd(const std::string& name) {
    v1::WatchJobRequest request;
    request.set_name(name);
    const auto context = As("alice");
    const auto reader = stub_->WatchJob(context.get(), request);
    v1::WatchJobResponse response;
    while (reader->Read(&response)) {
    }
  }

  /// Returns the digest of the map.
  std::string Download(const std::string& name) {
    v1::DownloadResultRequest request;
    request.set_name(name);
    const auto context = As("alice");
    const auto reader = stub_->DownloadResult(context.get(), request);
    std::string sha256;
    for (v1::DownloadResultResponse response; reader->Read(&response);) {
      if (response.has_header()) sha256 = response.header().digest().sha256();
    }
    reader->Finish();
    return sha256;
  }

  grpc::Status Upload(const std::string& key, const std::string& bytes) {
    v1::UploadMeshResponse response;
    const auto context = As(key);
    const auto writer = stub_->UploadMesh(context.get(), &response);
    v1::UploadMeshRequest message;
    message.mutable_header()->set_sha256(Sha256Hex(bytes));
    message.mutable_header()->set_size_bytes(bytes.size());
    writer->Write(message);
    message.set_chunk(bytes);
    writer->Write(message);
    writer->WritesDone();
    return writer->Finish();
  }

  /// From now on whoever opens the blob of alice waits until GoOn.
  void Stall(const std::string& sha256) {
    stalled_ = folder_.Path(
        absl::StrCat("data/blobs/alice/", sha256.substr(0, 2), "/", sha256));
    ASSERT_TRUE(std::filesystem::remove(stalled_));
    ASSERT_EQ(mkfifo(stalled_.c_str(), S_IRUSR | S_IWUSR), 0);
  }

  void GoOn() {
    if (stalled_.empty()) return;
    // Those who wait for the other end go on, and read its end.
    const int other_end = open(stalled_.c_str(), O_RDWR | O_CLOEXEC);
    std::filesystem::remove(stalled_);
    close(other_end);
    stalled_.clear();
  }

  void CallManyTimes(const std::function<void()>& call) {
    for (int i = 0; i < kCalls; ++i) calls_.emplace_back(call);
  }

  /// For as long as the calls may take to come in.
  void ExpectOthersAreAnswered(const std::function<void()>& call = nullptr) {
    const auto health = grpc::health::v1::Health::NewStub(channel_);
    for (int i = 0; i < 20; ++i) {
      const absl::Time begin = absl::Now();
      grpc::health::v1::HealthCheckResponse serving;
      v1::GetServerInfoResponse info;
      auto context = As("bob");
      context->set_deadline(absl::ToChronoTime(begin + absl::Seconds(3)));
      ASSERT_TRUE(health->Check(context.get(), {}, &serving).ok()) << i;
      context = As("bob");
      context->set_deadline(absl::ToChronoTime(begin + absl::Seconds(3)));
      ASSERT_TRUE(stub_->GetServerInfo(context.get(), {}, &info).ok()) << i;
      absl::SleepFor(absl::Milliseconds(20));
    }
    if (call) call();
  }

  static v1::DeleteJobRequest ToDelete(const std::string& name) {
    v1::DeleteJobRequest request;
    request.set_name(name);
    return request;
  }

  using Deletes = ManyCalls<v1::DeleteJobRequest, v1::DeleteJobResponse>;
  const Deletes::Start start_delete_ = [this](auto* context, auto* request,
                                              auto* response, auto on_end) {
    stub_->async()->DeleteJob(context, request, response, std::move(on_end));
  };

  const TemporaryFolder folder_;
  std::string stalled_;
  std::vector<std::jthread> calls_;
};

TEST_F(StalledDiskTest, WhileResultsAreRead) {
  const std::string name = Create("alice");
  WaitForEnd(name);
  Stall(Download(name));
  CallManyTimes([&, name] { Download(name); });
  ExpectOthersAreAnswered([&] {
    EXPECT_TRUE(Upload("bob", "a mesh").ok());
    Create("bob");
  });
}

TEST_F(StalledDiskTest, WhileUploadsLookWhetherTheMeshIsThere) {
  ASSERT_TRUE(Upload("alice", "a mesh").ok());
  Stall(Sha256Hex("a mesh"));
  CallManyTimes([&] { (void)Upload("alice", "a mesh"); });
  ExpectOthersAreAnswered([&] {
    EXPECT_TRUE(Upload("bob", "a mesh").ok());
    Create("bob");
  });
}

TEST_F(StalledDiskTest, WhileJobsAreCancelledAndDeleted) {
  gate_open_ = false;
  std::vector<std::string> names;
  for (int i = 0; i < kCalls; ++i) names.push_back(Create("alice"));
  SQLite::Database database(folder_.Path("data/jobs.sqlite"),
                            SQLite::OPEN_READWRITE);
  database.exec("BEGIN IMMEDIATE");
  for (const std::string& name : names) {
    calls_.emplace_back([this, name] {
      v1::CancelJobRequest request;
      request.set_name(name);
      v1::CancelJobResponse response;
      EXPECT_TRUE(stub_->CancelJob(As("alice").get(), request, &response).ok());
      v1::DeleteJobRequest remove;
      remove.set_name(name);
      v1::DeleteJobResponse removed;
      (void)stub_->DeleteJob(As("alice").get(), remove, &removed);
    });
  }
  ExpectOthersAreAnswered();
  database.exec("ROLLBACK");
}

TEST_F(StalledDiskTest, TooManyCallsThatWaitForItAreRefused) {
  constexpr int kWaiting = 512;
  constexpr int kRefused = 50;
  const std::string name = Create("alice");
  WaitForEnd(name);
  SQLite::Database database(folder_.Path("data/jobs.sqlite"),
                            SQLite::OPEN_READWRITE);
  database.exec("BEGIN IMMEDIATE");
  Deletes deletes(start_delete_);
  deletes.Begin(ToDelete(name), "alice");
  absl::SleepFor(absl::Milliseconds(100));  // it waits for the database
  for (int i = 0; i < kWaiting + kRefused; ++i) {
    deletes.Begin(ToDelete("jobs/nobody"), "alice");
  }
  for (const grpc::Status& status : deletes.WaitFor(kRefused)) {
    const CallError error = ErrorOf(status);
    EXPECT_EQ(error.code, grpc::StatusCode::RESOURCE_EXHAUSTED);
    EXPECT_EQ(error.reason, "TENANT_QUOTA");
    EXPECT_TRUE(error.has_retry);
  }
  v1::DeleteJobResponse response;
  EXPECT_EQ(
      stub_->DeleteJob(As("bob").get(), ToDelete("jobs/nobody"), &response)
          .error_code(),
      grpc::StatusCode::NOT_FOUND);
  EXPECT_EQ(deletes.WaitFor(0).size(), kRefused);
  database.exec("ROLLBACK");
}

TEST_F(StalledDiskTest, CallsThatEndedWhileTheyWaitedDoNothing) {
  const std::string first = Create("alice");
  const std::string kept = Create("alice");
  WaitForEnd(first);
  WaitForEnd(kept);
  SQLite::Database database(folder_.Path("data/jobs.sqlite"),
                            SQLite::OPEN_READWRITE);
  database.exec("BEGIN IMMEDIATE");
  Deletes deletes(start_delete_);
  deletes.Begin(ToDelete(first), "alice");
  absl::SleepFor(absl::Milliseconds(100));  // it waits for the database
  grpc::ClientContext& cancelled = deletes.Begin(ToDelete(kept), "alice");
  absl::SleepFor(absl::Milliseconds(100));  // it waits for the first
  cancelled.TryCancel();
  absl::SleepFor(absl::Milliseconds(100));  // the server has heard of it
  database.exec("ROLLBACK");
  deletes.WaitFor(2);
  // What comes later has its turn later.
  v1::DeleteJobResponse response;
  EXPECT_FALSE(
      stub_->DeleteJob(As("alice").get(), ToDelete("jobs/nobody"), &response)
          .ok());
  v1::GetJobRequest request;
  v1::GetJobResponse job;
  request.set_name(first);
  EXPECT_FALSE(stub_->GetJob(As("alice").get(), request, &job).ok());
  request.set_name(kept);
  EXPECT_TRUE(stub_->GetJob(As("alice").get(), request, &job).ok());
}

}  // namespace
}  // namespace isomatch
