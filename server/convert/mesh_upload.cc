#include "server/convert/mesh_upload.h"

#include <algorithm>
#include <cstdint>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/convert/digest.h"
#include "server/jobs/errors.h"

namespace isomatch {

absl::Status MeshUpload::Take(const v1::UploadMeshRequest& request) {
  absl::Status taken;
  if (request.has_header()) {
    taken = Begin(request);
  } else if (request.has_chunk()) {
    taken = Append(request.chunk());
  } else {
    taken = UploadMalformed("an empty message, expected header or chunk");
  }
  if (taken.ok()) return taken;
  // What has come may go on when there is room again.
  const bool goes_on = absl::IsResourceExhausted(taken) && leaves_bytes();
  stage_ = goes_on ? Stage::kBroken : Stage::kOver;
  if (!environment_.partials->AsksTheDisk()) BreakOff();
  return taken;
}

absl::Status MeshUpload::Begin(const v1::UploadMeshRequest& request) {
  if (stage_ != Stage::kNew) return UploadMalformed("a second header");
  ISOMATCH_RETURN_IF_ERROR(
      ValidateDigest(request.header(), "header", environment_.limits));
  digest_ = request.header();
  key_.sha256 = digest_.sha256();
  known_ = environment_.blobs->HasWhole(key_);  // or it would stay damaged
  stage_ = known_ ? Stage::kOver : Stage::kReceiving;
  return known_ ? absl::OkStatus() : ContinueAt(request.offset());
}

absl::Status MeshUpload::ContinueAt(std::uint64_t offset) {
  ISOMATCH_ASSIGN_OR_RETURN(PartialUpload kept,
                            environment_.partials->Take(key_));
  const std::uint64_t most =
      std::min<std::uint64_t>(kept.bytes.size(), digest_.size_bytes());
  if (offset > most) {
    environment_.partials->Keep(key_, std::move(kept));
    return UploadOffsetBeyond(offset, most);
  }
  const auto begin = static_cast<std::int64_t>(offset);
  const auto size = static_cast<std::int64_t>(digest_.size_bytes());
  kept.bytes.resize(offset);
  kept.reservation.ShrinkTo(begin);
  // Only looked for, so that the client need not send what has no room now:
  // what it says it will send takes no room from others.
  absl::Status room =
      environment_.partials->CheckRoom(key_.tenant, size - begin);
  if (!room.ok()) {
    environment_.partials->Keep(key_, std::move(kept));
    return room;
  }
  received_ = std::move(kept);
  received_.bytes.reserve(digest_.size_bytes());  // addresses, not memory yet
  sha256_.Update(received_.bytes);
  return absl::OkStatus();
}

absl::Status MeshUpload::Append(const std::string& chunk) {
  if (stage_ == Stage::kNew) {
    return UploadMalformed("a chunk before the header");
  }
  if (stage_ != Stage::kReceiving) {
    return UploadMalformed("a chunk after the end");
  }
  const auto most =
      static_cast<std::size_t>(environment_.limits.max_chunk_bytes);
  if (chunk.size() > most) {
    return UploadMalformed(absl::StrCat("a chunk of ", chunk.size(),
                                        " bytes, expected at most ", most));
  }
  if (chunk.size() > digest_.size_bytes() - received_.bytes.size()) {
    return UploadMalformed(absl::StrCat(
        "more bytes than the ", digest_.size_bytes(), " that the header says"));
  }
  ISOMATCH_ASSIGN_OR_RETURN(
      MemoryBudget::Reservation room,
      environment_.partials->Reserve(key_.tenant,
                                     static_cast<std::int64_t>(chunk.size())));
  received_.reservation.Merge(std::move(room));
  sha256_.Update(chunk);
  received_.bytes += chunk;
  return absl::OkStatus();
}

absl::Status MeshUpload::End() {
  if (stage_ == Stage::kNew) return UploadMalformed("no header came");
  if (stage_ != Stage::kReceiving) {
    return UploadMalformed("the upload has already ended");
  }
  const std::size_t received = received_.bytes.size();
  if (received != digest_.size_bytes()) {
    return UploadMalformed(absl::StrCat("the chunks have ", received,
                                        " bytes, the header says ",
                                        digest_.size_bytes()));
  }
  stage_ = Stage::kOver;
  return Store();
}

absl::Status MeshUpload::Store() {
  const std::string found = sha256_.HexDigest();
  if (found != key_.sha256) {
    environment_.partials->Forget(key_);
    return DigestMismatch(key_.sha256, found);
  }
  const auto size = static_cast<std::int64_t>(digest_.size_bytes());
  const std::int64_t most = environment_.limits.tenant.stored_bytes;
  absl::Status put = environment_.blobs->PutWithin(
      most, key_, std::move(received_.bytes), Keep::kWhileRoom);
  if (put.ok()) {
    environment_.partials->Forget(key_);
    return put;
  }
  if (absl::IsFailedPrecondition(put)) {
    return StorageQuota(key_.tenant, size, most);
  }
  if (!absl::IsResourceExhausted(put)) return StorageFailed(put);
  return UploadQuota(size, kRetryUploadQuota);
}

void MeshUpload::BreakOff() {
  if (!leaves_bytes()) return;
  stage_ = Stage::kOver;
  environment_.partials->Keep(key_, std::move(received_));
}

}  // namespace isomatch
