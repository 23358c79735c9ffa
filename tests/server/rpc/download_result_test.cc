#include <cstdint>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/storage/sha256.h"
#include "tests/server/test_server.h"
#include "tests/support/shapes.h"

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

}  // namespace
}  // namespace isomatch
