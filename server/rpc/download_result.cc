#include "server/rpc/download_result.h"

#include <cstdint>
#include <string>
#include <utility>

#include "core/base/status_macros.h"
#include "server/convert/job_name.h"
#include "server/jobs/errors.h"
#include "server/rpc/grpc_status.h"

namespace isomatch {
namespace {

constexpr size_t kChunkBytes = size_t{256} << 10;

absl::StatusOr<JobMap> FindMap(const ServiceContext& context,
                               const v1::DownloadResultRequest& request) {
  ISOMATCH_ASSIGN_OR_RETURN(const std::string id, ParseJobName(request.name()));
  ISOMATCH_ASSIGN_OR_RETURN(JobMap map, context.manager->GetMap(id));
  if (request.offset() > map.bytes->size()) {
    return OffsetOutOfRange(request.offset(),
                            static_cast<std::int64_t>(map.bytes->size()));
  }
  return map;
}

v1::DownloadResultResponse MakeHeader(const JobResult& result) {
  v1::DownloadResultResponse response;
  auto& header = *response.mutable_header();
  header.mutable_digest()->set_sha256(result.map_sha256);
  header.mutable_digest()->set_size_bytes(
      static_cast<std::uint64_t>(result.map_bytes));
  header.set_vertices_x(static_cast<std::uint32_t>(result.mesh_x.vertices));
  header.set_vertices_y(static_cast<std::uint32_t>(result.mesh_y.vertices));
  return response;
}

/// One DownloadResult call: writes the header, then in each OnWriteDone the
/// next chunk, one at a time; finishes after the last one, or when a write
/// fails because the client is gone. The map stays in memory until then.
class DownloadReactor final
    : public grpc::ServerWriteReactor<v1::DownloadResultResponse> {
 public:
  DownloadReactor(absl::StatusOr<JobMap> map, std::uint64_t offset)
      : map_(std::move(map)), offset_(offset) {
    if (!map_.ok()) {
      Finish(ToGrpc(map_.status()));
      return;
    }
    response_ = MakeHeader(*map_->record.result);
    StartWrite(&response_);
  }

  void OnWriteDone(bool ok) override {
    if (!ok) return Finish(grpc::Status::CANCELLED);
    if (offset_ == map_->bytes->size()) return Finish(grpc::Status::OK);
    response_.set_chunk(map_->bytes->substr(offset_, kChunkBytes));
    offset_ += response_.chunk().size();
    StartWrite(&response_);
  }

  void OnDone() override { delete this; }

 private:
  const absl::StatusOr<JobMap> map_;
  std::uint64_t offset_;
  v1::DownloadResultResponse response_;
};

}  // namespace

grpc::ServerWriteReactor<v1::DownloadResultResponse>* StartDownloadResult(
    const ServiceContext& context, const v1::DownloadResultRequest& request) {
  return new DownloadReactor(FindMap(context, request), request.offset());
}

}  // namespace isomatch
