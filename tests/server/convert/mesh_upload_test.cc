#include "server/convert/mesh_upload.h"

#include <optional>
#include <string>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/jobs/errors.h"
#include "server/storage/memory_blob_store.h"
#include "tests/server/manual_executor.h"
#include "tests/support/matchers.h"

namespace isomatch {
namespace {

constexpr char kTenant[] = "default";

using testing::_;
using testing::HasSubstr;

class MeshUploadTest : public testing::Test {
 protected:
  MeshUpload NewUpload(const std::string& tenant = kTenant) {
    return MeshUpload({&*blobs_, &partials_, limits_}, tenant);
  }

  v1::UploadMeshRequest Header(std::uint64_t offset = 0) const {
    v1::UploadMeshRequest request;
    request.mutable_header()->set_sha256(sha256_);
    request.mutable_header()->set_size_bytes(bytes_.size());
    request.set_offset(offset);
    return request;
  }

  static v1::UploadMeshRequest Chunk(const std::string& bytes) {
    v1::UploadMeshRequest request;
    request.set_chunk(bytes);
    return request;
  }

  /// Leaves the first `count` bytes behind.
  void BreakOffAfter(std::size_t count) {
    MeshUpload upload = NewUpload();
    ASSERT_THAT(upload.Take(Header()), IsOk());
    ASSERT_THAT(upload.Take(Chunk(bytes_.substr(0, count))), IsOk());
    upload.BreakOff();
  }

  std::size_t Received() const {
    return partials_.ReceivedBytes(kTenant, {sha256_}).front();
  }

  static auto Malformed(const std::string& why) {
    return StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr(why));
  }

  const std::string bytes_ = "0123456789";
  const std::string sha256_ = Sha256Hex(bytes_);
  RequestLimits limits_;
  std::optional<MemoryBlobStore> blobs_{std::in_place, 1 << 20};
  MemoryBudget budget_{100};
  ManualExecutor timers_;
  TenantBudgets budgets_{&budget_, budget_.total_bytes()};
  MemoryPartialUploads partials_{&budgets_, &timers_, absl::Minutes(5)};
};

TEST_F(MeshUploadTest, TheRestFromTheOffsetOnCompletesTheMesh) {
  for (const std::size_t offset : {0, 3, 6}) {
    blobs_.emplace(1 << 20);
    BreakOffAfter(6);
    EXPECT_EQ(Received(), 6);
    MeshUpload upload = NewUpload();
    ASSERT_THAT(upload.Take(Header(offset)), IsOk());
    EXPECT_EQ(budget_.reserved_bytes(), offset);
    EXPECT_EQ(Received(), 0);  // they are the new stream's now
    ASSERT_THAT(upload.Take(Chunk(bytes_.substr(offset))), IsOk());
    ASSERT_THAT(upload.End(), IsOk());
    EXPECT_EQ(**blobs_->Get({kTenant, sha256_}), bytes_);
  }
}

TEST_F(MeshUploadTest, AnOffsetBeyondWhatIsThereLeavesItThere) {
  BreakOffAfter(6);
  for (const std::uint64_t offset : {std::uint64_t{7}, ~std::uint64_t{0}}) {
    MeshUpload upload = NewUpload();
    const absl::Status status = upload.Take(Header(offset));
    EXPECT_THAT(status, Malformed("expected at most the 6 bytes"));
    EXPECT_EQ(DetailsOf(status).field, "offset");
    EXPECT_EQ(Received(), 6);
  }
  EXPECT_THAT(NewUpload("other").Take(Header(1)),
              Malformed("expected at most the 0 bytes"));
}

TEST_F(MeshUploadTest, ASmallerSizeThanBeforeBoundsTheOffset) {
  BreakOffAfter(6);
  v1::UploadMeshRequest header = Header(6);
  header.mutable_header()->set_size_bytes(4);
  EXPECT_THAT(NewUpload().Take(header), Malformed("at most the 4 bytes"));
}

TEST_F(MeshUploadTest, TwoStreamsOfOneMeshDoNotTouchEachOther) {
  BreakOffAfter(6);
  MeshUpload first = NewUpload();
  MeshUpload second = NewUpload();
  ASSERT_THAT(first.Take(Header(6)), IsOk());
  EXPECT_THAT(second.Take(Header(6)), Malformed("at most the 0 bytes"));
  MeshUpload third = NewUpload();
  ASSERT_THAT(third.Take(Header()), IsOk());
  ASSERT_THAT(third.Take(Chunk("wrong")), IsOk());
  ASSERT_THAT(first.Take(Chunk(bytes_.substr(6))), IsOk());
  third.BreakOff();
  EXPECT_THAT(first.End(), IsOk());
  EXPECT_EQ(**blobs_->Get({kTenant, sha256_}), bytes_);
}

TEST_F(MeshUploadTest, TooFewBytesAreKeptAsAfterALostConnection) {
  MeshUpload upload = NewUpload();
  ASSERT_THAT(upload.Take(Header()), IsOk());
  ASSERT_THAT(upload.Take(Chunk("0123")), IsOk());
  EXPECT_THAT(upload.End(), Malformed("the chunks have 4 bytes"));
  upload.BreakOff();
  EXPECT_EQ(Received(), 4);
}

TEST_F(MeshUploadTest, NothingIsKeptOfWhatWasWrong) {
  MeshUpload upload = NewUpload();
  ASSERT_THAT(upload.Take(Header()), IsOk());
  ASSERT_THAT(upload.Take(Chunk("0123456788")), IsOk());
  EXPECT_EQ(DetailsOf(upload.End()).reason, "DIGEST_MISMATCH");
  upload.BreakOff();
  MeshUpload twice = NewUpload();
  ASSERT_THAT(twice.Take(Header()), IsOk());
  ASSERT_THAT(twice.Take(Chunk("0123")), IsOk());
  EXPECT_THAT(twice.Take(Header()), Malformed("a second header"));
  twice.BreakOff();
  EXPECT_EQ(Received(), 0);
}

TEST_F(MeshUploadTest, MessagesAfterTheEndAreRefused) {
  ASSERT_THAT(blobs_->Put({kTenant, sha256_}, bytes_, Keep::kWhileRoom),
              IsOk());
  MeshUpload upload = NewUpload();
  ASSERT_THAT(upload.Take(Header()), IsOk());
  EXPECT_TRUE(upload.known());
  EXPECT_THAT(upload.Take(Chunk("x")), Malformed("after the end"));
  EXPECT_THAT(upload.End(), Malformed("already ended"));
  EXPECT_THAT(NewUpload().Take({}), Malformed("an empty message"));
  EXPECT_THAT(NewUpload().End(), Malformed("no header"));
}

TEST_F(MeshUploadTest, TakesRoomForWhatHasComeOnly) {
  MeshUpload upload = NewUpload();
  ASSERT_THAT(upload.Take(Header()), IsOk());
  EXPECT_EQ(budget_.reserved_bytes(), 0);
  ASSERT_THAT(upload.Take(Chunk("0123")), IsOk());
  EXPECT_EQ(budget_.reserved_bytes(), 4);
}

TEST_F(MeshUploadTest, WhatHasComeIsKeptWhenThereIsNoRoomForTheRest) {
  MeshUpload upload = NewUpload();
  ASSERT_THAT(upload.Take(Header()), IsOk());
  ASSERT_THAT(upload.Take(Chunk("0123")), IsOk());
  auto others = budget_.Reserve(95);
  ASSERT_THAT(others, IsOk());
  EXPECT_EQ(DetailsOf(upload.Take(Chunk("45"))).reason, "UPLOAD_QUOTA");
  EXPECT_EQ(Received(), 4);
  *others = MemoryBudget::Reservation();
  MeshUpload again = NewUpload();
  ASSERT_THAT(again.Take(Header(4)), IsOk());
  ASSERT_THAT(again.Take(Chunk("456789")), IsOk());
  EXPECT_THAT(again.End(), IsOk());
}

TEST_F(MeshUploadTest, WhatIsKeptSurvivesThatThereIsNoRoomToGoOn) {
  BreakOffAfter(6);
  const auto others = budget_.Reserve(94);
  ASSERT_THAT(others, IsOk());
  EXPECT_THAT(NewUpload().Take(Header(6)),
              StatusIs(absl::StatusCode::kResourceExhausted, _));
  EXPECT_EQ(Received(), 6);
}

}  // namespace
}  // namespace isomatch
