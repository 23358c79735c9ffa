#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"
#include "core/base/sha256.h"
#include "tests/server/test_server.h"
#include "tests/support/shapes.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

class DownloadResultTest : public TestServer {
 protected:
  struct Download {
    v1::DownloadResultResponse::Header header;
    std::string map;
    size_t largest_chunk = 0;
    grpc::Status status;
  };

  Download Get(const std::string& name, std::uint64_t offset) {
    grpc::ClientContext context;
    v1::DownloadResultRequest request;
    request.set_name(name);
    request.set_offset(offset);
    const auto reader = stub_->DownloadResult(&context, request);
    Download download;
    v1::DownloadResultResponse response;
    if (reader->Read(&response)) download.header = response.header();
    while (reader->Read(&response)) {
      download.largest_chunk =
          std::max(download.largest_chunk, response.chunk().size());
      download.map += response.chunk();
    }
    download.status = reader->Finish();
    return download;
  }
};

TEST_F(DownloadResultTest, GivesHeaderAndMap) {
  const std::string name = CreateJob();
  Watch(name);
  const Download download = Get(name, 0);
  EXPECT_TRUE(download.status.ok());
  EXPECT_EQ(download.header.vertices_x(), 42);
  EXPECT_EQ(download.header.vertices_y(), 4);
  EXPECT_EQ(download.header.digest().size_bytes(), 42 * 4);
  EXPECT_EQ(download.header.digest().sha256(), Sha256Hex(download.map));
  for (size_t i = 0; i < 42; ++i) {
    EXPECT_EQ(download.map[4 * i], static_cast<char>(i % 4)) << i;
  }
}

TEST_F(DownloadResultTest, ResumesAtAnyOffsetInChunksOfAQuarterMebibyte) {
  v1::CreateJobRequest request = SphereJob();
  *request.mutable_mesh_x() = ToDraco(PlaneGrid(300, 299, 1, 1));
  const std::string name = CreateJob(request);
  Watch(name);
  const Download whole = Get(name, 0);
  ASSERT_EQ(whole.map.size(), 301 * 300 * 4);
  EXPECT_EQ(whole.largest_chunk, 256 << 10);
  for (const size_t offset :
       {size_t{1}, size_t{256 << 10}, size_t{300'001}, whole.map.size()}) {
    EXPECT_EQ(Get(name, offset).map, whole.map.substr(offset)) << offset;
  }
  EXPECT_EQ(ErrorOf(Get(name, whole.map.size() + 1).status).reason,
            "OFFSET_OUT_OF_RANGE");
}

TEST_F(DownloadResultTest, IsRefusedWhileTheJobRuns) {
  gate_open_ = false;
  const CallError error = ErrorOf(Get(CreateJob(), 0).status);
  EXPECT_EQ(error.code, grpc::StatusCode::FAILED_PRECONDITION);
  EXPECT_EQ(error.reason, "JOB_NOT_SUCCEEDED");
  EXPECT_EQ(ErrorOf(Get("jobs/nobody", 0).status).reason, "JOB_NOT_FOUND");
}

/// Two tenants, whose calls carry their keys.
class DownloadsOfTenantsTest : public TestServer {
 protected:
  using Reader =
      std::unique_ptr<grpc::ClientReader<v1::DownloadResultResponse>>;

  DownloadsOfTenantsTest() {
    ServerConfig config = TestConfig();
    config.api_keys = folder_.Write("keys", KeysOf({"alice", "bob"}));
    config.memory_budget_bytes = 208 << 20;  // 1.6 MiB for what each is sent
    Restart(config);
    grpc::ChannelArguments small_window;
    small_window.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
    small_window.SetInt(GRPC_ARG_HTTP2_BDP_PROBE, 0);
    small_window.SetInt(GRPC_ARG_HTTP2_STREAM_LOOKAHEAD_BYTES, 65535);
    stub_ = v1::CorrespondenceService::NewStub(grpc::CreateCustomChannel(
        server_->address(), grpc::InsecureChannelCredentials(), small_window));
  }

  /// Returns the name of a job with a map of 160 kB.
  std::string JobOf(const char* key) {
    grpc::ClientContext create;
    create.AddMetadata("api-key", key);
    v1::CreateJobRequest job = SphereJob();
    *job.mutable_mesh_x() = ToDraco(PlaneGrid(200, 199, 1, 1));
    v1::CreateJobResponse created;
    const grpc::Status status = stub_->CreateJob(&create, job, &created);
    EXPECT_TRUE(status.ok()) << status.error_message();
    grpc::ClientContext watch;
    watch.AddMetadata("api-key", key);
    v1::WatchJobRequest request;
    request.set_name(created.job().name());
    const auto snapshots = stub_->WatchJob(&watch, request);
    for (v1::WatchJobResponse response; snapshots->Read(&response);) {
    }
    return created.job().name();
  }

  Reader Begin(grpc::ClientContext& context, const char* key,
               const std::string& name) {
    context.AddMetadata("api-key", key);
    v1::DownloadResultRequest request;
    request.set_name(name);
    return stub_->DownloadResult(&context, request);
  }

  const TemporaryFolder folder_;
};

TEST_F(DownloadsOfTenantsTest, WhatIsBeingSentIsBoundedForEach) {
  const std::string of_alice = JobOf("alice");
  const std::string of_bob = JobOf("bob");
  v1::DownloadResultResponse response;
  std::array<grpc::ClientContext, 4> contexts;
  std::vector<Reader> unread;
  CallError error{grpc::StatusCode::OK, "", ""};
  for (grpc::ClientContext& context : contexts) {
    Reader reader = Begin(context, "alice", of_alice);
    if (reader->Read(&response)) {
      unread.push_back(std::move(reader));
    } else {
      error = ErrorOf(reader->Finish());
    }
  }
  EXPECT_EQ(unread.size(), 2);
  EXPECT_EQ(error.reason, "CONTENT_UNAVAILABLE");
  EXPECT_TRUE(error.has_retry);
  grpc::ClientContext others;
  EXPECT_TRUE(Begin(others, "bob", of_bob)->Read(&response));
  others.TryCancel();
  for (const Reader& reader : unread) {
    while (reader->Read(&response)) {
    }
    EXPECT_TRUE(reader->Finish().ok());
  }
  grpc::ClientContext again;
  EXPECT_TRUE(Begin(again, "alice", of_alice)->Read(&response));
  again.TryCancel();
}

}  // namespace
}  // namespace isomatch
