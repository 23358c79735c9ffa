#include "server/rpc/download_result.h"

#include <cstdint>
#include <string>
#include <utility>

#include "core/base/status_macros.h"
#include "server/convert/job_name.h"
#include "server/convert/job_proto.h"
#include "server/jobs/errors.h"
#include "server/jobs/within_memory.h"
#include "server/rpc/grpc_status.h"

namespace isomatch {
namespace {

constexpr size_t kChunkBytes = size_t{256} << 10;

absl::StatusOr<JobPart> FindRequested(
    const ServiceContext& context, const Caller& caller,
    const v1::DownloadResultRequest& request) {
  ISOMATCH_ASSIGN_OR_RETURN(const std::string id, ParseJobName(request.name()));
  ISOMATCH_ASSIGN_OR_RETURN(const ResultPart wanted,
                            ParseResultPart(request.part(), "part"));
  ISOMATCH_ASSIGN_OR_RETURN(JobPart found,
                            context.manager->GetPart(caller, id, wanted));
  if (request.offset() > found.bytes->size()) {
    return OffsetOutOfRange(request.offset(), found.part.bytes);
  }
  return found;
}

v1::DownloadResultResponse MakeHeader(const JobPart& found) {
  v1::DownloadResultResponse response;
  auto& header = *response.mutable_header();
  header.mutable_digest()->set_sha256(found.part.sha256);
  header.mutable_digest()->set_size_bytes(
      static_cast<std::uint64_t>(found.part.bytes));
  header.set_vertices_x(
      static_cast<std::uint32_t>(found.result.mesh_x.vertices));
  header.set_vertices_y(
      static_cast<std::uint32_t>(found.result.mesh_y.vertices));
  return response;
}

/// One DownloadResult call: writes the header, then in each OnWriteDone the
/// next chunk, one at a time; finishes after the last one, or when a write
/// fails because the client is gone. The part stays in memory until then.
class DownloadReactor final
    : public grpc::ServerWriteReactor<v1::DownloadResultResponse> {
 public:
  DownloadReactor(absl::StatusOr<JobPart> part, std::uint64_t offset)
      : part_(std::move(part)), offset_(offset) {
    if (!part_.ok()) {
      Finish(ToGrpc(part_.status()));
      return;
    }
    response_ = MakeHeader(*part_);
    StartWrite(&response_);
  }

  void OnWriteDone(bool ok) override {
    if (!ok) return Finish(grpc::Status::CANCELLED);
    if (offset_ == part_->bytes->size()) return Finish(grpc::Status::OK);
    const absl::Status taken = WithinMemory([&] {
      response_.set_chunk(part_->bytes->substr(offset_, kChunkBytes));
      return absl::OkStatus();
    });
    if (!taken.ok()) return Finish(ToGrpc(taken));
    offset_ += response_.chunk().size();
    StartWrite(&response_);
  }

  void OnDone() override { delete this; }

 private:
  const absl::StatusOr<JobPart> part_;
  std::uint64_t offset_;
  v1::DownloadResultResponse response_;
};

}  // namespace

grpc::ServerWriteReactor<v1::DownloadResultResponse>* StartDownloadResult(
    const ServiceContext& context, const Caller& caller,
    const v1::DownloadResultRequest& request) {
  return new DownloadReactor(
      WithinMemory([&] { return FindRequested(context, caller, request); }),
      request.offset());
}

}  // namespace isomatch
