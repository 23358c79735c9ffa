#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/time/clock.h"
#include "core/base/sha256.h"
#include "tests/server/test_server.h"
#include "tests/support/shapes.h"
#include "tests/support/small_disk.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

using testing::HasSubstr;

/// A server with a data directory that is stopped and started again.
class DurabilityTest : public TestServer {
 protected:
  DurabilityTest() { Again(); }

  ServerConfig Durable() const {
    ServerConfig config = TestConfig();
    config.data_dir = folder_.Path("data");
    return config;
  }

  void Again() { Restart(Durable()); }

  /// Of the only tenant.
  std::string Blobs() const { return folder_.Path("data/blobs/default"); }

  grpc::Status Download(const std::string& name, std::string& bytes) {
    grpc::ClientContext context;
    v1::DownloadResultRequest request;
    request.set_name(name);
    const auto reader = stub_->DownloadResult(&context, request);
    for (v1::DownloadResultResponse part; reader->Read(&part);) {
      bytes += part.chunk();
    }
    return reader->Finish();
  }

  /// Changes every file of meshes, requests and results.
  void DamageBlobs() const {
    for (const auto& entry :
         std::filesystem::recursive_directory_iterator(Blobs())) {
      if (!entry.is_regular_file()) continue;
      std::fstream file(entry.path(),
                        std::ios::in | std::ios::out | std::ios::binary);
      file << "damaged";
    }
  }

  grpc::Status Upload(const std::string& bytes) {
    grpc::ClientContext context;
    v1::UploadMeshResponse response;
    const auto writer = stub_->UploadMesh(&context, &response);
    v1::UploadMeshRequest request;
    request.mutable_header()->set_sha256(Sha256Hex(bytes));
    request.mutable_header()->set_size_bytes(bytes.size());
    writer->Write(request);
    request.set_chunk(bytes);
    if (writer->Write(request)) writer->WritesDone();
    return writer->Finish();
  }

  TemporaryFolder folder_;
};

TEST_F(DurabilityTest, QueuedAndRunningJobsRunWhenTheServerStartsAgain) {
  gate_open_ = false;
  const std::string running = CreateJob();
  const std::string queued = CreateJob();
  WaitForMatches(1);
  server_->Shutdown(absl::ZeroDuration());
  gate_open_ = true;
  Again();
  for (const std::string& name : {running, queued}) {
    const v1::Job job = Watch(name).back();
    EXPECT_EQ(job.state(), v1::Job::STATE_SUCCEEDED);
    EXPECT_EQ(job.attempt(), 1);
  }
}

TEST_F(DurabilityTest, ResultsAreTheSameAfterward) {
  const std::string name = CreateJob();
  const v1::Job before = Watch(name).back();
  std::string bytes;
  ASSERT_TRUE(Download(name, bytes).ok());
  Again();
  const v1::Job after = GetJob(name);
  EXPECT_EQ(after.SerializeAsString(), before.SerializeAsString());
  std::string again;
  ASSERT_TRUE(Download(name, again).ok());
  EXPECT_FALSE(bytes.empty());
  EXPECT_EQ(again, bytes);
}

TEST_F(DurabilityTest, AWatcherIsToldThatTheJobGoesOnLater) {
  gate_open_ = false;
  const std::string name = CreateJob();
  WaitForMatches(1);
  grpc::ClientContext context;
  v1::WatchJobRequest request;
  request.set_name(name);
  const auto reader = stub_->WatchJob(&context, request);
  v1::WatchJobResponse response;
  ASSERT_TRUE(reader->Read(&response));
  std::thread stopping([&] { server_->Shutdown(absl::ZeroDuration()); });
  while (reader->Read(&response)) {
    EXPECT_LE(response.job().state(), v1::Job::STATE_RUNNING);
  }
  const CallError error = ErrorOf(reader->Finish());
  stopping.join();
  EXPECT_EQ(error.code, grpc::StatusCode::UNAVAILABLE);
  EXPECT_EQ(error.reason, "DRAINING");
  EXPECT_TRUE(error.has_retry);
  gate_open_ = true;
  Again();
  EXPECT_EQ(Watch(name, response.job().sequence()).back().state(),
            v1::Job::STATE_SUCCEEDED);
}

TEST_F(DurabilityTest, AWatcherIsToldItThoughAMessageIsJustOnItsWay) {
  MatchEngine engine = GatedEngine();
  engine.match =
      [&](auto&&, auto&&, auto&&, auto&&,
          const MatchControl& control) -> absl::StatusOr<Correspondence> {
    ++matches_;
    while (
        !control.stop.stop_requested()) {  // ends while QUEUED is being written
    }
    return absl::CancelledError("cancelled");
  };
  Restart(Durable(), engine);
  const std::string name = CreateJob();
  for (int round = 0; round < 20; ++round) {
    if (round > 0) Restart(Durable(), engine);
    WaitForMatches(round + 1);
    grpc::ClientContext context;
    v1::WatchJobRequest request;
    request.set_name(name);
    const auto reader = stub_->WatchJob(&context, request);
    v1::WatchJobResponse response;
    ASSERT_TRUE(reader->Read(&response));
    std::thread stopping([&] { server_->Shutdown(absl::ZeroDuration()); });
    while (reader->Read(&response)) {
    }
    const grpc::Status status = reader->Finish();
    stopping.join();
    ASSERT_EQ(ErrorOf(status).reason, "DRAINING") << "in round " << round;
  }
}

TEST_F(DurabilityTest, UploadedMeshesNeedNotBeSentAgain) {
  v1::CreateJobRequest request = SphereJob();
  const std::string name = CreateJob(request);
  Watch(name);
  Again();
  // The meshes came within the request; their content is known by digest now.
  v1::CreateJobRequest by_digest = request;
  v1::FindMissingMeshesRequest find;
  for (v1::Mesh* mesh :
       {by_digest.mutable_mesh_x(), by_digest.mutable_mesh_y()}) {
    v1::Digest digest;
    digest.set_sha256(Sha256Hex(mesh->draco()));
    digest.set_size_bytes(mesh->draco().size());
    *mesh->mutable_digest() = digest;
    *find.add_digests() = digest;
  }
  grpc::ClientContext context;
  v1::FindMissingMeshesResponse missing;
  ASSERT_TRUE(stub_->FindMissingMeshes(&context, find, &missing).ok());
  EXPECT_EQ(missing.missing_size(), 0);
  EXPECT_EQ(Watch(CreateJob(by_digest)).back().state(),
            v1::Job::STATE_SUCCEEDED);
}

TEST_F(DurabilityTest, TheSameMeshesSentAgainHealDamagedFiles) {
  Watch(CreateJob());
  DamageBlobs();
  EXPECT_EQ(Watch(CreateJob()).back().state(), v1::Job::STATE_SUCCEEDED);
}

TEST_F(DurabilityTest, AMeshUploadedAgainHealsItsDamagedFile) {
  const std::string bytes = SphereJob().mesh_x().draco();
  ASSERT_TRUE(Upload(bytes).ok());
  DamageBlobs();
  ASSERT_TRUE(Upload(bytes).ok());
  v1::CreateJobRequest request = SphereJob();
  v1::Digest& digest = *request.mutable_mesh_x()->mutable_digest();
  digest.set_sha256(Sha256Hex(bytes));
  digest.set_size_bytes(bytes.size());
  EXPECT_EQ(Watch(CreateJob(request)).back().state(), v1::Job::STATE_SUCCEEDED);
}

TEST_F(DurabilityTest, JobsWaitForAFullDiskAlsoAcrossARestart) {
  const SmallDisk disk(/*mebibytes=*/4);
  if (!disk.problem().empty()) GTEST_SKIP() << disk.problem();
  ServerConfig config = TestConfig();
  config.data_dir = disk.Path("data");
  Restart(config);
  on_found_ = [this](auto&&, auto&&, Correspondence& found) {
    found.confidence.assign(42, 0.001f * static_cast<float>(matches_));
  };
  const std::string ended = CreateJob();
  Watch(ended);
  gate_open_ = false;
  v1::CreateJobRequest other = SphereJob();
  other.mutable_options()->set_random_seed(7);
  const std::string running = CreateJob(other);
  const std::string queued = CreateJob(other);
  WaitForMatches(2);
  disk.Fill();
  gate_open_ = true;
  for (const std::string& name : {running, queued}) {
    v1::Job job;
    do {
      job = GetJob(name);
      absl::SleepFor(absl::Milliseconds(10));
    } while (job.state() <= v1::Job::STATE_RUNNING &&
             job.waiting_for() != v1::Job::WAIT_REASON_STORAGE);
    EXPECT_EQ(job.state(), v1::Job::STATE_QUEUED);
  }
  EXPECT_EQ(CreateError(SphereJob()).reason, "STORAGE_FAILED");
  Restart(config);
  grpc::ClientContext context;
  v1::DeleteJobRequest request;
  request.set_name(ended);
  v1::DeleteJobResponse response;
  EXPECT_TRUE(stub_->DeleteJob(&context, request, &response).ok());
  disk.Empty();
  for (const std::string& name : {running, queued}) {
    EXPECT_EQ(Watch(name).back().state(), v1::Job::STATE_SUCCEEDED);
  }
  Restart(TestConfig());  // before its disk goes
}

TEST_F(DurabilityTest, AResultWhoseFileIsGoneIsLost) {
  const std::string name = CreateJob();
  Watch(name);
  std::filesystem::remove_all(Blobs());
  std::string bytes;
  const CallError error = ErrorOf(Download(name, bytes));
  EXPECT_EQ(error.code, grpc::StatusCode::DATA_LOSS);
  EXPECT_EQ(error.reason, "CONTENT_LOST");
  EXPECT_EQ(bytes, "");
}

TEST_F(DurabilityTest, AJobThatCannotBeStoredIsNotAccepted) {
  std::filesystem::remove_all(Blobs());
  std::ofstream(Blobs()) << "no folder";
  const CallError error = CreateError(SphereJob());
  EXPECT_EQ(error.code, grpc::StatusCode::UNAVAILABLE);
  EXPECT_EQ(error.reason, "STORAGE_FAILED");
  EXPECT_TRUE(error.has_retry);
  std::filesystem::remove(Blobs());
  EXPECT_EQ(Watch(CreateJob()).back().state(), v1::Job::STATE_SUCCEEDED);
}

TEST_F(DurabilityTest, TwoServersDoNotShareAFolder) {
  const auto second = Server::Create(Durable());
  EXPECT_EQ(second.status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(second.status().message()),
              HasSubstr(folder_.Path("data")));
}

TEST_F(DurabilityTest, InfoSaysWhatIsKept) {
  grpc::ClientContext context;
  v1::GetServerInfoResponse info;
  ASSERT_TRUE(stub_->GetServerInfo(&context, {}, &info).ok());
  EXPECT_TRUE(info.durable());
  EXPECT_EQ(info.job_retention().seconds(), 7 * 24 * 3600);
}

// Written by the last commit whose records had no JobResult::info: a job of two
// samples of 120 vertices, by the paper's profile, with two landmarks.
TEST_F(DurabilityTest, ResultsOfVersionThreeAreServed) {
  server_.reset();
  std::filesystem::remove_all(folder_.Path("data"));
  std::filesystem::copy(
      std::filesystem::path(ISOMATCH_STORAGE_DATA) / "version3",
      folder_.Path("data"), std::filesystem::copy_options::recursive);
  Again();
  const std::string name = "jobs/f733fb4f2dc432c570ee4528e05317c5";
  const v1::Job job = GetJob(name);
  EXPECT_EQ(job.state(), v1::Job::STATE_SUCCEEDED);
  EXPECT_EQ(job.progress().stage(), v1::STAGE_QUALITY);
  const v1::ResultInfo& result = job.result();
  EXPECT_EQ(result.mesh_x().vertices(), 120);
  EXPECT_EQ(result.mesh_y().faces(), 236);
  EXPECT_EQ(result.mesh_x().area(), 1.238380657563566);
  EXPECT_EQ(result.verdict().level(), v1::Verdict::LEVEL_BAD);
  EXPECT_THAT(result.verdict().reason(), HasSubstr("mean confidence 0.39"));
  ASSERT_EQ(result.landmarks_size(), 2);
  EXPECT_FALSE(result.landmarks(1).kept());
  EXPECT_EQ(result.landmarks(1).y_found(), 69);
  EXPECT_EQ(result.landmarks(1).distance(), 0.15155982971191406);
  EXPECT_EQ(result.orientation_score(), 0.5254585411877333);
  EXPECT_EQ(result.scores().rank_value(), -0.008965138226064656);
  EXPECT_EQ(result.quality().area_distortion(), 1.450155587702353);
  EXPECT_EQ(result.profile(), v1::PROFILE_PAPER);
  EXPECT_EQ(result.random_seed(), 1);
  EXPECT_THAT(result.warnings(), testing::ElementsAre(HasSubstr("landmarks")));
  ASSERT_EQ(result.stage_times_size(), 9);
  EXPECT_EQ(result.stage_times(7).stage(), v1::STAGE_ZOOMOUT);
  EXPECT_EQ(result.stage_times(7).seconds(), 0.03548234);
  EXPECT_EQ(result.stage_times(8).stage(), v1::STAGE_QUALITY);
  std::string map;
  EXPECT_TRUE(Download(name, map).ok());
  EXPECT_EQ(map.size(), 4 * 120);
}

}  // namespace
}  // namespace isomatch
