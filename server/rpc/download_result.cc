#include "server/rpc/download_result.h"

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/convert/job_name.h"
#include "server/convert/job_proto.h"
#include "server/convert/result_info.h"
#include "server/jobs/errors.h"
#include "server/jobs/within_memory.h"
#include "server/rpc/grpc_status.h"
#include "server/rpc/raw_message.h"

namespace isomatch {
namespace {

constexpr size_t kChunkBytes = size_t{256} << 10;

/// A part that is being sent.
struct PartInMemory {
  JobPart found;
  MemoryBudget::Reservation room;
};

/// Room for what GetPart will read; for nothing when it will not. One part has
/// room in any case, so that none is too large to be ever had.
absl::StatusOr<MemoryBudget::Reservation> ReservePart(
    const ServiceContext& context, const Caller& caller, const std::string& id,
    ResultPart part) {
  ISOMATCH_ASSIGN_OR_RETURN(const JobSnapshot job,
                            context.manager->Get(caller, id));
  const std::optional<JobResult>& result = job.record.result;
  const StoredPart* const stored = result ? FindPart(*result, part) : nullptr;
  if (stored == nullptr) return MemoryBudget::Reservation();
  MemoryBudget& room = context.downloads->Of(caller.tenant);
  const std::int64_t bytes =
      stored->bytes + static_cast<std::int64_t>(2 * kChunkBytes);
  auto reserved = room.Reserve(std::min(bytes, room.total_bytes()));
  if (reserved.ok()) return reserved;
  return ContentUnavailable(
      "result", absl::ResourceExhaustedError(absl::StrCat(
                    "those that are being sent to ", caller.tenant,
                    " may take ", room.total_bytes(), " bytes of memory")));
}

absl::StatusOr<PartInMemory> ReadPart(
    const ServiceContext& context, const Caller& caller,
    const v1::DownloadResultRequest& request) {
  ISOMATCH_ASSIGN_OR_RETURN(const std::string id, ParseJobName(request.name()));
  ISOMATCH_ASSIGN_OR_RETURN(const ResultPart wanted,
                            ParseResultPart(request.part(), "part"));
  ISOMATCH_ASSIGN_OR_RETURN(MemoryBudget::Reservation room,
                            ReservePart(context, caller, id, wanted));
  ISOMATCH_ASSIGN_OR_RETURN(JobPart found,
                            context.manager->GetPart(caller, id, wanted));
  if (request.offset() > found.bytes->size()) {
    return OffsetOutOfRange(request.offset(), found.part.bytes);
  }
  return PartInMemory{std::move(found), std::move(room)};
}

v1::DownloadResultResponse MakeHeader(const JobPart& found) {
  v1::DownloadResultResponse response;
  auto& header = *response.mutable_header();
  header.mutable_digest()->set_sha256(found.part.sha256);
  header.mutable_digest()->set_size_bytes(
      static_cast<std::uint64_t>(found.part.bytes));
  const v1::ResultInfo info = ResultInfoOf(found.result);
  header.set_vertices_x(info.mesh_x().vertices());
  header.set_vertices_y(info.mesh_y().vertices());
  return response;
}

/// One DownloadResult call.
///
///   1. Begin: waits for the tenant's turn; finishes when too many do.
///   2. Open, a thread of the disk: reads the part, writes the header; finishes
///      on an error.
///   3. OnWriteDone: writes the next chunk, one at a time; finishes after the
///      last one, or when a write fails because the client is gone. The part
///      stays in memory until then.
class DownloadReactor final
    : public grpc::ServerWriteReactor<grpc::ByteBuffer> {
 public:
  DownloadReactor(const ServiceContext& context, Caller caller,
                  v1::DownloadResultRequest request)
      : context_(context),
        caller_(std::move(caller)),
        request_(std::move(request)),
        offset_(request_.offset()) {}

  void Begin() {
    const absl::Status posted = WithinMemory([&] {
      return context_.disk->Post(caller_.tenant, [this] { Open(); });
    });
    if (!posted.ok()) End(ToGrpc(posted));
  }

  void OnCancel() override { is_cancelled_ = true; }

  void OnWriteDone(bool ok) override {
    if (!ok) return End(grpc::Status::CANCELLED);
    const std::string& bytes = *part_->found.bytes;
    if (offset_ == bytes.size()) return End(grpc::Status::OK);
    const absl::Status written = WithinMemory([&] {
      v1::DownloadResultResponse response;
      response.set_chunk(bytes.substr(offset_, kChunkBytes));
      response_ = SerializeRaw(response);
      offset_ += response.chunk().size();
      return absl::OkStatus();
    });
    if (!written.ok()) return End(ToGrpc(written));
    StartWrite(&response_);
  }

  void OnDone() override { delete this; }

 private:
  void Open() {
    // Nobody waits for the answer of a call that has ended meanwhile.
    if (is_cancelled_) return End(grpc::Status::CANCELLED);
    const absl::Status opened = WithinMemory([&]() -> absl::Status {
      ISOMATCH_ASSIGN_OR_RETURN(part_, ReadPart(context_, caller_, request_));
      response_ = SerializeRaw(MakeHeader(part_->found));
      return absl::OkStatus();
    });
    if (!opened.ok()) return End(ToGrpc(opened));
    StartWrite(&response_);
  }

  /// The peer may take its time to hear of the end.
  void End(const grpc::Status& status) {
    part_.reset();
    Finish(status);
  }

  const ServiceContext& context_;
  const Caller caller_;
  const v1::DownloadResultRequest request_;
  std::uint64_t offset_;
  std::atomic<bool> is_cancelled_ = false;
  std::optional<PartInMemory> part_;
  grpc::ByteBuffer response_;
};

}  // namespace

grpc::ServerWriteReactor<grpc::ByteBuffer>* StartDownloadResult(
    const ServiceContext& context, Caller caller,
    v1::DownloadResultRequest request) {
  auto* const reactor =
      new DownloadReactor(context, std::move(caller), std::move(request));
  reactor->Begin();
  return reactor;
}

}  // namespace isomatch
