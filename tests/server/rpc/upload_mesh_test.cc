#include <cstdint>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/time/clock.h"
#include "core/base/sha256.h"
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
                      const std::vector<std::string>& chunks,
                      std::uint64_t offset = 0) {
    grpc::ClientContext context;
    const auto writer = stub_->UploadMesh(&context, &response_);
    v1::UploadMeshRequest request;
    *request.mutable_header() = digest;
    request.set_offset(offset);
    writer->Write(request);
    for (const std::string& chunk : chunks) {
      request.set_chunk(chunk);
      if (!writer->Write(request)) break;
    }
    writer->WritesDone();
    return writer->Finish();
  }

  /// Uploads the first `count` bytes and ends there; returns when they are
  /// kept.
  void BreakOff(const std::string& bytes, std::uint64_t count) {
    const grpc::Status status =
        Upload(DigestOf(bytes), {bytes.substr(0, count)});
    EXPECT_EQ(ErrorOf(status).reason, "UPLOAD_MALFORMED");
    WaitForReceived(DigestOf(bytes), count);
  }

  /// Uploads the first `count` bytes and cancels after `pause`; true when they
  /// had arrived by then.
  bool Cancel(const std::string& bytes, std::uint64_t count,
              absl::Duration pause) {
    grpc::ClientContext context;
    const auto writer = stub_->UploadMesh(&context, &response_);
    v1::UploadMeshRequest request;
    *request.mutable_header() = DigestOf(bytes);
    writer->Write(request);
    request.set_chunk(bytes.substr(0, count));
    writer->Write(request);
    absl::SleepFor(pause);
    context.TryCancel();
    writer->Finish();
    absl::SleepFor(pause);
    return Received(DigestOf(bytes)) == count;
  }

  std::uint64_t Received(const v1::Digest& digest) {
    return FindMissing(digest).received_bytes(0);
  }

  void WaitForReceived(const v1::Digest& digest, std::uint64_t bytes) {
    while (Received(digest) != bytes) absl::SleepFor(absl::Milliseconds(1));
  }

  grpc::Status Continue(const std::string& bytes, std::uint64_t offset) {
    return Upload(DigestOf(bytes), {bytes.substr(offset)}, offset);
  }

  v1::FindMissingMeshesResponse FindMissing(const v1::Digest& digest) {
    grpc::ClientContext context;
    v1::FindMissingMeshesRequest request;
    *request.add_digests() = digest;
    v1::FindMissingMeshesResponse response;
    EXPECT_TRUE(stub_->FindMissingMeshes(&context, request, &response).ok());
    EXPECT_EQ(response.missing_size(), response.received_bytes_size());
    return response;
  }

  int CountMissing(const v1::Digest& digest) {
    return FindMissing(digest).missing_size();
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
  v1::UploadMeshResponse never;
  const auto open = stub_->UploadMesh(&context, &never);
  open->Write(request);
  v1::Digest other = request.header();
  other.set_sha256(std::string(64, 'b'));
  // What it says it will bring takes no room from others.
  EXPECT_EQ(ErrorOf(Upload(other, {})).reason, "UPLOAD_MALFORMED");
  request.set_chunk("x");
  open->Write(request);
  CallError error = ErrorOf(Upload(other, {}));
  while (error.reason == "UPLOAD_MALFORMED") {  // until it has arrived
    absl::SleepFor(absl::Milliseconds(1));
    error = ErrorOf(Upload(other, {}));
  }
  EXPECT_EQ(error.reason, "UPLOAD_QUOTA");
  EXPECT_TRUE(error.has_retry);
  // Others create their jobs meanwhile.
  v1::CreateJobRequest job = SphereJob();
  job.set_validate_only(true);
  grpc::ClientContext create;
  v1::CreateJobResponse created;
  EXPECT_TRUE(stub_->CreateJob(&create, job, &created).ok());
  context.TryCancel();
  open->Finish();
}

TEST_F(UploadMeshTest, ATenantsBytesAreBounded) {
  ServerConfig config = TestConfig();
  config.max_mesh_bytes = 1 << 20;
  config.max_request_bytes = 2 << 20;
  config.max_bytes_per_tenant = 4 << 20;
  Restart(config);
  // Nobody uses them: the oldest give way.
  std::string last;
  for (const char fill : {'a', 'b', 'c', 'd', 'e', 'f'}) {
    last.assign(1 << 20, fill);
    EXPECT_TRUE(Upload(DigestOf(last), {last}).ok());
  }
  EXPECT_TRUE(Upload(DigestOf(last), {}).ok());
  const std::string first(1 << 20, 'a');
  EXPECT_FALSE(Upload(DigestOf(first), {}).ok());
}

TEST_F(UploadMeshTest, ACancelledUploadGoesOnWhereItWas) {
  const std::string bytes(100'000, 'x');
  // The bytes have to arrive before the client cancels.
  absl::Duration pause = absl::Milliseconds(10);
  while (!Cancel(bytes, 60'000, pause)) pause *= 2;
  EXPECT_TRUE(Continue(bytes, 60'000).ok());
  EXPECT_EQ(CountMissing(DigestOf(bytes)), 0);
}

TEST_F(UploadMeshTest, BytesBeyondTheOffsetAreDropped) {
  const std::string bytes = "0123456789";
  BreakOff(bytes, 8);
  EXPECT_TRUE(Continue(bytes, 3).ok());
  EXPECT_EQ(CountMissing(DigestOf(bytes)), 0);
}

TEST_F(UploadMeshTest, AnOffsetBeyondWhatIsThereIsRefusedAndCostsNothing) {
  const std::string bytes = "0123456789";
  BreakOff(bytes, 8);
  const CallError error = ErrorOf(Continue(bytes, 9));
  EXPECT_EQ(error.code, grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(error.reason, "UPLOAD_MALFORMED");
  EXPECT_EQ(error.field, "offset");
  EXPECT_EQ(Received(DigestOf(bytes)), 8);
}

TEST_F(UploadMeshTest, ATricklingUploadIsDropped) {
  ServerConfig config = TestConfig();
  config.upload_idle_timeout = absl::Milliseconds(500);  // 512 bytes
  Restart(config);
  const std::string bytes(10'000, 'x');
  grpc::ClientContext context;
  const auto writer = stub_->UploadMesh(&context, &response_);
  v1::UploadMeshRequest request;
  *request.mutable_header() = DigestOf(bytes);
  writer->Write(request);
  request.set_chunk("x");
  while (writer->Write(request)) absl::SleepFor(absl::Milliseconds(10));
  EXPECT_EQ(ErrorOf(writer->Finish()).reason, "UPLOAD_IDLE");
}

TEST_F(UploadMeshTest, ALargeMeshHasToComeFaster) {
  ServerConfig config = TestConfig();
  config.upload_idle_timeout = absl::Milliseconds(500);
  Restart(config);
  grpc::ClientContext context;
  const auto writer = stub_->UploadMesh(&context, &response_);
  v1::UploadMeshRequest request;
  request.mutable_header()->set_sha256(std::string(64, 'a'));
  request.mutable_header()->set_size_bytes(32 << 20);  // 4660 in this time
  writer->Write(request);
  request.set_chunk(std::string(60, 'x'));  // 3000 at most
  const absl::Time end = absl::Now() + absl::Seconds(10);
  while (writer->Write(request)) {
    absl::SleepFor(absl::Milliseconds(10));
    if (absl::Now() > end) context.TryCancel();
  }
  EXPECT_EQ(ErrorOf(writer->Finish()).reason, "UPLOAD_IDLE");
}

TEST_F(UploadMeshTest, AnIdleUploadGoesOnWhereItWas) {
  ServerConfig config = TestConfig();
  config.upload_idle_timeout = absl::Milliseconds(500);
  Restart(config);
  const std::string bytes = "0123456789";
  grpc::ClientContext context;
  const auto writer = stub_->UploadMesh(&context, &response_);
  v1::UploadMeshRequest request;
  *request.mutable_header() = DigestOf(bytes);
  writer->Write(request);
  request.set_chunk(bytes.substr(0, 4));
  writer->Write(request);
  EXPECT_EQ(ErrorOf(writer->Finish()).reason, "UPLOAD_IDLE");
  WaitForReceived(DigestOf(bytes), 4);
  EXPECT_TRUE(Continue(bytes, 4).ok());
}

TEST_F(UploadMeshTest, WhatBrokeOffIsForgottenAfterAWhile) {
  ServerConfig config = TestConfig();
  config.partial_upload_kept = absl::Milliseconds(300);
  Restart(config);
  const std::string bytes = "0123456789";
  BreakOff(bytes, 8);
  WaitForReceived(DigestOf(bytes), 0);
  EXPECT_EQ(ErrorOf(Continue(bytes, 1)).field, "offset");
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
