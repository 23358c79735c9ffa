#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/time/clock.h"
#include "server/storage/sha256.h"
#include "tests/server/test_server.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

class UploadMeshTest : public TestServer {
 protected:
  static v1::Digest DigestOf(const std::string& bytes) {
    v1::Digest digest;
    digest.set_sha256(Sha256Hex(bytes));
    digest.set_size_bytes(bytes.size());
    return digest;
  }

  grpc::Status Upload(const v1::Digest& digest,
                      const std::vector<std::string>& chunks) {
    grpc::ClientContext context;
    const auto writer = stub_->UploadMesh(&context, &response_);
    v1::UploadMeshRequest request;
    *request.mutable_header() = digest;
    writer->Write(request);
    for (const std::string& chunk : chunks) {
      request.set_chunk(chunk);
      if (!writer->Write(request)) break;
    }
    writer->WritesDone();
    return writer->Finish();
  }

  int CountMissing(const v1::Digest& digest) {
    grpc::ClientContext context;
    v1::FindMissingMeshesRequest request;
    *request.add_digests() = digest;
    v1::FindMissingMeshesResponse response;
    EXPECT_TRUE(stub_->FindMissingMeshes(&context, request, &response).ok());
    return response.missing_size();
  }

  v1::UploadMeshResponse response_;
};

TEST_F(UploadMeshTest, AnUploadedMeshCanBeUsedAndNeedNotBeSentAgain) {
  const v1::Mesh mesh = ToDraco(UnitSphere(1));
  const std::string& bytes = mesh.draco();
  const v1::Digest digest = DigestOf(bytes);
  EXPECT_EQ(CountMissing(digest), 1);
  EXPECT_TRUE(Upload(digest, {bytes.substr(0, 10), bytes.substr(10)}).ok());
  EXPECT_FALSE(response_.known());
  EXPECT_EQ(CountMissing(digest), 0);
  EXPECT_TRUE(Upload(digest, {}).ok());
  EXPECT_TRUE(response_.known());
  v1::CreateJobRequest request = SphereJob();
  *request.mutable_mesh_x()->mutable_digest() = digest;
  const v1::Job job = Watch(CreateJob(request)).back();
  EXPECT_EQ(job.result().mesh_x().vertices(), 42);
}

TEST_F(UploadMeshTest, AnotherContentThanTheDigestSaysIsNotKept) {
  const v1::Digest digest = DigestOf("right");
  const CallError error = ErrorOf(Upload(digest, {"wrong"}));
  EXPECT_EQ(error.code, grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(error.reason, "DIGEST_MISMATCH");
  EXPECT_EQ(CountMissing(digest), 1);
}

TEST_F(UploadMeshTest, AnotherSizeThanSaidIsRefused) {
  v1::Digest digest = DigestOf("right");
  EXPECT_EQ(ErrorOf(Upload(digest, {"righ"})).reason, "UPLOAD_MALFORMED");
  EXPECT_EQ(ErrorOf(Upload(digest, {"right", "x"})).reason, "UPLOAD_MALFORMED");
  digest.set_size_bytes(std::uint64_t{1} << 60);
  const CallError error = ErrorOf(Upload(digest, {}));
  EXPECT_EQ(error.reason, "MESH_TOO_LARGE");
  EXPECT_EQ(error.field, "header.size_bytes");
}

TEST_F(UploadMeshTest, ABadDigestIsRefused) {
  v1::Digest digest = DigestOf("right");
  digest.set_sha256("0123");
  EXPECT_EQ(ErrorOf(Upload(digest, {"right"})).field, "header.sha256");
}

TEST_F(UploadMeshTest, MessagesInAnotherOrderAreRefused) {
  grpc::ClientContext context;
  const auto writer = stub_->UploadMesh(&context, &response_);
  v1::UploadMeshRequest request;
  request.set_chunk("x");
  writer->Write(request);
  writer->WritesDone();
  EXPECT_EQ(ErrorOf(writer->Finish()).reason, "UPLOAD_MALFORMED");
}

TEST_F(UploadMeshTest, AChunkOverTheLimitIsRefused) {
  const std::string bytes((1 << 20) + 1, 'x');
  EXPECT_EQ(ErrorOf(Upload(DigestOf(bytes), {bytes})).reason,
            "UPLOAD_MALFORMED");
}

TEST_F(UploadMeshTest, WhatUnfinishedUploadsMayHoldTogetherIsBounded) {
  ServerConfig config = TestConfig();
  config.blob_store_bytes = 16 << 20;
  config.max_mesh_bytes = 8 << 20;
  Restart(config);
  v1::UploadMeshRequest request;
  request.mutable_header()->set_sha256(std::string(64, 'a'));
  request.mutable_header()->set_size_bytes(8 << 20);
  grpc::ClientContext context;
  const auto open = stub_->UploadMesh(&context, &response_);
  open->Write(request);
  v1::Digest other = request.header();
  other.set_sha256(std::string(64, 'b'));
  absl::SleepFor(absl::Milliseconds(200));  // until the first has arrived
  const CallError error = ErrorOf(Upload(other, {}));
  EXPECT_EQ(error.reason, "UPLOAD_QUOTA");
  EXPECT_TRUE(error.has_retry);
  context.TryCancel();
  open->Finish();
}

TEST_F(UploadMeshTest, AnIdleUploadIsDropped) {
  ServerConfig config = TestConfig();
  config.upload_idle_timeout = absl::Milliseconds(30);
  Restart(config);
  grpc::ClientContext context;
  const auto writer = stub_->UploadMesh(&context, &response_);
  v1::UploadMeshRequest request;
  *request.mutable_header() = DigestOf("right");
  writer->Write(request);
  EXPECT_EQ(ErrorOf(writer->Finish()).reason, "UPLOAD_IDLE");
}

}  // namespace
}  // namespace isomatch
