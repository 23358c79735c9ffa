// Gateways and workers within the test's process, on a real PostgreSQL: what
// one process says, and what another hears.

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <pqxx/pqxx>

#include "absl/time/clock.h"
#include "core/base/sha256.h"
#include "grpc/health/v1/health.grpc.pb.h"
#include "server/server.h"
#include "server/shared_stores.h"
#include "tests/server/many_calls.h"
#include "tests/server/postgres/test_database.h"
#include "tests/server/test_server.h"
#include "tests/support/matchers.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

/// The fixture's own server is the first gateway; there is no worker at first.
class ClusterTest : public TestServer {
 protected:
  void SetUp() override {
    ASSERT_THAT(NewDatabase(), IsOk());  // its tables stay
    server_ = Start(Config("gateway"));
    channel_ = grpc::CreateChannel(server_->address(),
                                   grpc::InsecureChannelCredentials());
    stub_ = v1::CorrespondenceService::NewStub(channel_);
  }

  static ServerConfig Config(const std::string& role) {
    ServerConfig config = TestConfig();
    config.store = (*TheServer())->url();
    config.role = role;
    config.log_level = "off";
    config.lease = absl::Seconds(2);
    config.unwatched_grace = absl::Milliseconds(500);
    config.unresponsive_grace = absl::Seconds(1);
    if (role == "worker") config.listen = "";
    return config;
  }

  std::unique_ptr<Server> Start(const ServerConfig& config) {
    auto created =
        Server::Create(config, GatedEngine(), nullptr, OpenAnyStores);
    EXPECT_THAT(created, IsOk());
    return created.ok() ? *std::move(created) : nullptr;
  }

  /// The fixture's calls go to this gateway from now on.
  void CallAt(const Server& gateway) {
    channel_ = grpc::CreateChannel(gateway.address(),
                                   grpc::InsecureChannelCredentials());
    stub_ = v1::CorrespondenceService::NewStub(channel_);
  }

  v1::Job WaitFor(const std::string& name, v1::Job::State state) {
    v1::Job job = GetJob(name);
    for (int i = 0; i < 1000 && job.state() != state; ++i) {
      absl::SleepFor(absl::Milliseconds(20));
      job = GetJob(name);
    }
    EXPECT_EQ(job.state(), state) << job.ShortDebugString();
    return job;
  }

  v1::Job Cancel(const std::string& name) {
    grpc::ClientContext context;
    v1::CancelJobRequest request;
    request.set_name(name);
    v1::CancelJobResponse response;
    EXPECT_TRUE(stub_->CancelJob(&context, request, &response).ok());
    return response.job();
  }

  grpc::Status Delete(const std::string& name) {
    grpc::ClientContext context;
    v1::DeleteJobRequest request;
    request.set_name(name);
    v1::DeleteJobResponse response;
    return stub_->DeleteJob(&context, request, &response);
  }

  static void Do(const std::string& sql) {
    pqxx::connection database((*TheServer())->url());
    pqxx::work work(database);
    work.exec(sql);
    work.commit();
  }

  v1::GetServerInfoResponse Info() {
    grpc::ClientContext context;
    v1::GetServerInfoResponse info;
    EXPECT_TRUE(stub_->GetServerInfo(&context, {}, &info).ok());
    return info;
  }
};

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
  Do("UPDATE isomatch.live_jobs SET sequence = sequence - 1000000");
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

TEST_F(ClusterTest, MeshesAndResultsMayBeInAFolder) {
  const TemporaryFolder folder;
  ServerConfig gateway = Config("gateway");
  ServerConfig worker = Config("worker");
  gateway.blob_dir = folder.Path("");
  worker.blob_dir = folder.Path("");
  const auto other = Start(gateway);
  const auto runs = Start(worker);
  CallAt(*other);
  const std::string name = CreateJob();
  WaitFor(name, v1::Job::STATE_SUCCEEDED);
  pqxx::connection database((*TheServer())->url());
  pqxx::nontransaction rows(database);
  EXPECT_EQ(
      rows.exec("SELECT count(*) FROM isomatch.blob_chunks")[0][0].as<int>(),
      0);
  EXPECT_GT(rows.exec("SELECT count(file) FROM isomatch.blobs")[0][0].as<int>(),
            0);
}

TEST_F(ClusterTest, WhoeverLacksTheFolderThatHasFilesDoesNotStart) {
  const TemporaryFolder folder;
  ServerConfig config = Config("all");
  config.blob_dir = folder.Path("");
  {
    const auto all = Start(config);
    CallAt(*all);
    WaitFor(CreateJob(), v1::Job::STATE_SUCCEEDED);
    all->Shutdown(absl::ZeroDuration());
  }
  EXPECT_THAT(
      Server::Create(Config("worker"), GatedEngine(), nullptr, OpenAnyStores),
      StatusIs(absl::StatusCode::kFailedPrecondition,
               testing::HasSubstr("--blob-dir is not set")));
}

TEST_F(ClusterTest, AFullDiskCostsAJobNeitherItsResultNorAnAttempt) {
  gate_open_ = false;
  const auto worker = Start(Config("worker"));
  const std::string name = CreateJob();
  WaitForMatches(1);
  Do("CREATE FUNCTION isomatch.full() RETURNS trigger LANGUAGE plpgsql AS "
     "$$ BEGIN RAISE 'no space' USING ERRCODE = '53100'; END $$;"
     "CREATE TRIGGER full_disk BEFORE DELETE ON isomatch.live_jobs "
     "FOR EACH ROW EXECUTE FUNCTION isomatch.full()");
  gate_open_ = true;
  absl::SleepFor(absl::Seconds(3));  // longer than a lease
  EXPECT_EQ(GetJob(name).state(), v1::Job::STATE_RUNNING);
  Do("DROP TRIGGER full_disk ON isomatch.live_jobs");
  EXPECT_EQ(WaitFor(name, v1::Job::STATE_SUCCEEDED).attempt(), 1);
  EXPECT_EQ(matches_, 1);
}

/// Another role than that of `migrate`, with the rights of server/README.md.
TEST_F(ClusterTest, ARoleThatMayUseTheTablesIsEnough) {
  Do("DROP ROLE IF EXISTS r");
  Do("CREATE ROLE r LOGIN;"
     "GRANT USAGE ON SCHEMA isomatch TO r;"
     "GRANT SELECT, INSERT, UPDATE, DELETE ON ALL TABLES IN SCHEMA isomatch "
     "TO r; GRANT USAGE ON ALL SEQUENCES IN SCHEMA isomatch TO r");
  ServerConfig config = Config("all");
  config.store = "postgresql://r@/isomatch?host=" + (*TheServer())->folder();
  {
    const auto all = Start(config);
    CallAt(*all);
    const std::string name = CreateJob();
    WaitFor(name, v1::Job::STATE_SUCCEEDED);
    EXPECT_TRUE(Delete(name).ok());
    gate_open_ = false;
    EXPECT_EQ(Cancel(CreateJob()).state(), v1::Job::STATE_CANCELLED);
    gate_open_ = true;
    all->Shutdown(absl::ZeroDuration());
  }
  Do("DROP OWNED BY r; DROP ROLE r");
}

TEST_F(ClusterTest, ADamagedRecordFailsItsJobOnly) {
  const std::string damaged = CreateJob();
  const std::string whole = CreateJob();
  Do("UPDATE isomatch.jobs SET record = 'damaged' WHERE id = '" +
     damaged.substr(damaged.find('/') + 1) + "'");
  const auto worker = Start(Config("worker"));
  EXPECT_EQ(WaitFor(damaged, v1::Job::STATE_FAILED).error().reason(),
            "CONTENT_LOST");
  WaitFor(whole, v1::Job::STATE_SUCCEEDED);
  Do("UPDATE isomatch.jobs SET record = 'damaged'");
  EXPECT_EQ(GetJob(whole).error().reason(), "CONTENT_LOST");
  EXPECT_TRUE(Delete(whole).ok());
  EXPECT_TRUE(Delete(damaged).ok());
}

TEST_F(ClusterTest, AFolderOfAnotherDatabaseIsRefused) {
  const TemporaryFolder folder;
  folder.Write("isomatch-blobs", "another");
  ServerConfig config = Config("gateway");
  config.blob_dir = folder.Path("");
  EXPECT_THAT(Server::Create(config, GatedEngine(), nullptr, OpenAnyStores),
              StatusIs(absl::StatusCode::kUnavailable,
                       testing::HasSubstr("not the folder of this database")));
}

TEST_F(ClusterTest, AFolderThatCannotBeUsedIsRefusedByItsFlag) {
  const TemporaryFolder folder;
  ServerConfig config = Config("gateway");
  for (const std::string& path :
       {folder.Path("nope"), folder.Write("file", "no folder")}) {
    config.blob_dir = path;
    EXPECT_THAT(OpenAnyStores(config).status(),
                StatusIs(absl::StatusCode::kUnavailable,
                         "--blob-dir = " + path +
                             ": no such folder, expected one that exists"));
  }
  config.blob_dir = "/proc/self";  // where nobody makes files
  EXPECT_THAT(OpenAnyStores(config).status(),
              StatusIs(absl::StatusCode::kUnavailable,
                       testing::HasSubstr("--blob-dir = /proc/self: cannot")));
}

TEST_F(ClusterTest, MigrateSaysWhatItDidAndWhere) {
  const std::string place = " isomatch at " + (*TheServer())->folder();
  const ServerConfig config = Config("all");
  const auto migrate = [&] {
    const auto said = MigrateStore(config);
    EXPECT_THAT(said, IsOk());
    return said.value_or("");
  };
  EXPECT_THAT(migrate(), testing::StartsWith("nothing to do: the tables of" +
                                             place + " have version "));
  Do("DROP SCHEMA isomatch CASCADE");
  EXPECT_THAT(migrate(),
              testing::StartsWith("made the tables of" + place + ", version "));
}

TEST_F(ClusterTest, APasswordFileWithoutAPasswordIsRefused) {
  const TemporaryFolder folder;
  ServerConfig config = Config("gateway");
  for (const std::string& text : {std::string(), std::string("\nsecond")}) {
    config.store_password_file = folder.Write("password", text);
    EXPECT_THAT(
        OpenAnyStores(config).status(),
        StatusIs(absl::StatusCode::kUnavailable,
                 testing::HasSubstr("--store-password-file = " +
                                    folder.Path("password") + " is empty")));
  }
  config.store_password_file = folder.Path("none");
  EXPECT_THAT(OpenAnyStores(config).status(),
              StatusIs(absl::StatusCode::kUnavailable,
                       testing::HasSubstr("--store-password-file = " +
                                          folder.Path("none") + ": cannot")));
}

class ClusterUploadTest : public ClusterTest {
 protected:
  /// Begins an upload at `offset`, sends `bytes`, and cancels or ends it.
  grpc::Status Upload(std::uint64_t offset, const std::string& bytes,
                      bool cancels) {
    grpc::ClientContext context;
    v1::UploadMeshResponse response;
    const auto writer = stub_->UploadMesh(&context, &response);
    v1::UploadMeshRequest request;
    *request.mutable_header() = digest_;
    request.set_offset(offset);
    writer->Write(request);
    request.set_chunk(bytes);
    writer->Write(request);
    if (cancels) {
      absl::SleepFor(absl::Milliseconds(300));  // the bytes arrive
      context.TryCancel();
    } else {
      writer->WritesDone();
    }
    return writer->Finish();
  }

  /// Returns how many bytes are there; -1 when the mesh is.
  std::int64_t Received() {
    grpc::ClientContext context;
    v1::FindMissingMeshesRequest request;
    *request.add_digests() = digest_;
    v1::FindMissingMeshesResponse response;
    EXPECT_TRUE(stub_->FindMissingMeshes(&context, request, &response).ok());
    if (response.missing_size() == 0) return -1;
    return static_cast<std::int64_t>(response.received_bytes(0));
  }

  bool WaitForReceived(std::int64_t bytes) {
    for (int i = 0; i < 250 && Received() != bytes; ++i) {
      absl::SleepFor(absl::Milliseconds(20));
    }
    return Received() == bytes;
  }

  const std::string bytes_ = SphereJob().mesh_x().draco();
  const v1::Digest digest_ = [this] {
    v1::Digest digest;
    digest.set_sha256(Sha256Hex(bytes_));
    digest.set_size_bytes(bytes_.size());
    return digest;
  }();
};

TEST_F(ClusterUploadTest, AnUploadThatBrokeOffGoesOnAtAnyGateway) {
  const auto other = Start(Config("gateway"));
  const auto third = Start(Config("gateway"));
  const std::size_t half = bytes_.size() / 2;
  EXPECT_FALSE(Upload(0, bytes_.substr(0, half), /*cancels=*/true).ok());
  server_->Shutdown(absl::ZeroDuration());  // it is gone for good
  CallAt(*other);
  ASSERT_TRUE(WaitForReceived(static_cast<std::int64_t>(half)));
  EXPECT_FALSE(Upload(half, bytes_.substr(half, 5), /*cancels=*/true).ok());
  CallAt(*third);
  ASSERT_TRUE(WaitForReceived(static_cast<std::int64_t>(half) + 5));
  EXPECT_TRUE(Upload(half + 5, bytes_.substr(half + 5), false).ok());
  EXPECT_EQ(Received(), -1);
}

TEST_F(ClusterUploadTest, WhatDidNotGoOnGoesWithTheChores) {
  EXPECT_FALSE(Upload(0, bytes_.substr(0, 9), /*cancels=*/true).ok());
  ASSERT_TRUE(WaitForReceived(9));
  pqxx::connection database((*TheServer())->url());
  pqxx::nontransaction rows(database);
  rows.exec("UPDATE isomatch.partial_uploads SET kept_at = '-infinity'");
  rows.exec("DELETE FROM isomatch.chores");
  EXPECT_EQ(Received(), 0);
  const auto other = Start(Config("gateway"));  // its first chores are all
  const auto count = [&] {
    return rows.exec("SELECT count(*) FROM isomatch.partial_uploads")[0][0]
        .as<int>();
  };
  for (int i = 0; i < 500 && count() > 0; ++i) {
    absl::SleepFor(absl::Milliseconds(20));
  }
  EXPECT_EQ(count(), 0);
}

TEST_F(ClusterTest, WhatADeletedJobLeavesGoesWithTheChores) {
  const auto worker = Start(Config("worker"));
  const std::string name = CreateJob();
  WaitFor(name, v1::Job::STATE_SUCCEEDED);
  ASSERT_TRUE(Delete(name).ok());
  pqxx::connection database((*TheServer())->url());
  pqxx::nontransaction rows(database);
  const auto count = [&] {
    return rows.exec("SELECT count(*) FROM isomatch.blobs")[0][0].as<int>();
  };
  EXPECT_GT(count(), 0) << "removed before others can be done with it";
  rows.exec(
      "UPDATE isomatch.blobs SET used_at = used_at - interval '11 min', "
      "remove_at = remove_at - interval '11 min'");
  rows.exec("DELETE FROM isomatch.chores");
  const auto other = Start(Config("gateway"));  // its first chores are all
  for (int i = 0; i < 500 && count() > 0; ++i) {
    absl::SleepFor(absl::Milliseconds(20));
  }
  EXPECT_EQ(count(), 0);
}

}  // namespace
}  // namespace isomatch
