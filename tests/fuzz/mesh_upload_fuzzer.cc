// Several UploadMesh streams of a few contents, in any order of messages,
// ends and breaks, while time passes. Whatever happens:
//
//   1. the store holds only bytes under their own digest;
//   2. the room reserved is at most the budget, and comes back in the end;
//   3. what FindMissingMeshes would tell is accepted as an offset;
//   4. an upload that brings the right rest ends well.
//
// The input is a list of steps, see Step.

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "core/base/sha256.h"
#include "server/convert/mesh_upload.h"
#include "server/storage/memory_blob_store.h"
#include "tests/fuzz/byte_reader.h"
#include "tests/fuzz/check.h"
#include "tests/server/manual_executor.h"

namespace isomatch {
namespace {

constexpr char kTenant[] = "default";

constexpr std::int64_t kBudgetBytes = 500;

const std::array<std::string, 3>& Contents() {
  static const std::array<std::string, 3> contents = {"", "0123456789",
                                                      std::string(200, 'x')};
  return contents;
}

class FuzzedUploads {
 public:
  FuzzedUploads() {
    limits_.max_chunk_bytes = 64;
    limits_.max_mesh_bytes = 256;
  }

  ~FuzzedUploads() {
    for (int i = 0; i < kStreams; ++i) BreakOff(i);
    timers_.Advance(absl::Minutes(5));
    ISOMATCH_CHECK(budget_.reserved_bytes() == 0);
    for (const std::string& content : Contents()) CheckStored(content);
  }

  void Step(ByteReader& reader) {
    const std::uint8_t what = reader.Byte();
    const int stream = what / 16 % kStreams;
    switch (what % 8) {
      case 0:
        Take(stream, Header(reader));
        break;
      case 1:
        TakeRight(stream, reader.Byte());
        break;
      case 2:
        Take(stream, Chunk(reader.Text(reader.Byte())));
        break;
      case 3:
        End(stream);
        break;
      case 4:
        BreakOff(stream);
        break;
      case 5:
        timers_.Advance(absl::Seconds(reader.Byte()));
        break;
      case 6:
        Complete(Contents()[reader.Byte() % Contents().size()], reader.Byte());
        break;
      default:
        Take(stream, {});
    }
    ISOMATCH_CHECK(budget_.reserved_bytes() <= kBudgetBytes);
  }

 private:
  static constexpr int kStreams = 3;

  static v1::UploadMeshRequest Chunk(const std::string& bytes) {
    v1::UploadMeshRequest request;
    request.set_chunk(bytes);
    return request;
  }

  static v1::UploadMeshRequest HeaderOf(const std::string& content,
                                        std::uint64_t offset) {
    v1::UploadMeshRequest request;
    request.mutable_header()->set_sha256(Sha256Hex(content));
    request.mutable_header()->set_size_bytes(content.size());
    request.set_offset(offset);
    return request;
  }

  /// Of a content, with another size, with an offset, or not a digest at all.
  static v1::UploadMeshRequest Header(ByteReader& reader) {
    const std::uint8_t kind = reader.Byte();
    v1::UploadMeshRequest request = HeaderOf(
        Contents()[kind % Contents().size()], kind & 16 ? reader.Byte() : 0);
    if (kind & 32) request.set_offset(reader.Number());
    if (kind & 64) request.mutable_header()->set_size_bytes(reader.Number());
    if (kind & 128) request.mutable_header()->set_sha256(reader.Text(64));
    return request;
  }

  MeshUpload& Stream(int index) {
    auto& stream = streams_[static_cast<std::size_t>(index)];
    if (!stream) {
      stream.emplace(MeshUpload::Environment{&blobs_, &partials_, limits_},
                     index == 0 ? "other" : kTenant);
      sent_[static_cast<std::size_t>(index)] = 0;
    }
    return *stream;
  }

  void Take(int index, const v1::UploadMeshRequest& request) {
    const absl::Status taken = Stream(index).Take(request);
    auto& sent = sent_[static_cast<std::size_t>(index)];
    sent =
        request.has_header() ? request.offset() : sent + request.chunk().size();
    if (!taken.ok()) streams_[static_cast<std::size_t>(index)].reset();
  }

  /// The bytes that belong there, if the digest is that of a content.
  void TakeRight(int index, std::size_t count) {
    const std::string& sha256 = Stream(index).digest().sha256();
    const std::uint64_t sent = sent_[static_cast<std::size_t>(index)];
    for (const std::string& content : Contents()) {
      if (Sha256Hex(content) != sha256 || sent > content.size()) continue;
      return Take(index, Chunk(content.substr(sent, count)));
    }
  }

  void End(int index) {
    (void)Stream(index).End();
    BreakOff(index);
  }

  void BreakOff(int index) {
    Stream(index).BreakOff();
    streams_[static_cast<std::size_t>(index)].reset();
  }

  /// What a client does: asks, goes on there or a little before, and begins
  /// anew when that fails, because others left wrong bytes. Then only a lack of
  /// room can be the cause.
  void Complete(const std::string& content, std::size_t before) {
    const std::size_t received =
        std::min(partials_.ReceivedBytes(kTenant, {Sha256Hex(content)}).front(),
                 content.size());
    const std::size_t offset = received - std::min(before, received);
    const bool stored = SendFrom(offset, content) || SendFrom(0, content);
    ISOMATCH_CHECK(stored || !HasRoom(content));
    CheckStored(content);
  }

  bool HasRoom(const std::string& content) {
    return partials_.Reserve(kTenant, static_cast<std::int64_t>(content.size()))
        .ok();
  }

  /// Returns whether the content is in the store.
  bool SendFrom(std::size_t offset, const std::string& content) {
    MeshUpload upload({&blobs_, &partials_, limits_}, kTenant);
    const absl::Status begun = upload.Take(HeaderOf(content, offset));
    ISOMATCH_CHECK(begun.ok() || absl::IsResourceExhausted(begun));
    if (!begun.ok()) return false;
    if (upload.known()) return true;
    const auto step = static_cast<std::size_t>(limits_.max_chunk_bytes);
    for (std::size_t at = offset; at < content.size(); at += step) {
      ISOMATCH_CHECK(upload.Take(Chunk(content.substr(at, step))).ok());
    }
    const absl::Status stored = upload.End();
    ISOMATCH_CHECK(stored.ok() || offset > 0);
    return stored.ok();
  }

  void CheckStored(const std::string& content) {
    const auto blob = blobs_.Get({kTenant, Sha256Hex(content)});
    ISOMATCH_CHECK(!blob.ok() || **blob == content);
  }

  RequestLimits limits_;
  MemoryBlobStore blobs_{1 << 20};
  MemoryBudget budget_{kBudgetBytes};
  ManualExecutor timers_;
  TenantBudgets budgets_{&budget_, budget_.total_bytes()};
  MemoryPartialUploads partials_{&budgets_, &timers_, absl::Minutes(5)};
  std::array<std::optional<MeshUpload>, kStreams> streams_;
  /// Where the next right byte of each stream is.
  std::array<std::uint64_t, kStreams> sent_ = {};
};

}  // namespace
}  // namespace isomatch

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data,
                                      std::size_t size) {
  isomatch::ByteReader reader(data, size);
  isomatch::FuzzedUploads uploads;
  while (!reader.empty()) uploads.Step(reader);
  return 0;
}
