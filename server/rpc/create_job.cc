#include "server/rpc/create_job.h"

#include <algorithm>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include <grpcpp/server_context.h>

#include "core/base/status_macros.h"
#include "server/convert/job_proto.h"
#include "server/convert/stored_request.h"
#include "server/jobs/errors.h"
#include "server/jobs/within_memory.h"
#include "server/rpc/grpc_status.h"

namespace isomatch {
namespace {

/// What a waiting request counts with at least, so that there are not too many
/// small ones: those of `validate_only` need no place in the queue.
constexpr std::int64_t kLeastBytes = 16 << 10;

absl::StatusOr<JobSnapshot> Create(const ServiceContext& context,
                                   const Caller& caller,
                                   const v1::CreateJobRequest& request,
                                   JobManager::Place place) {
  const std::string sha256 =
      request.request_id().empty() ? "" : RequestSha256(request);
  ISOMATCH_ASSIGN_OR_RETURN(
      const std::optional<JobSnapshot> before,
      context.manager->FindRequest(caller, request.request_id(), sha256));
  if (before) return *before;
  ISOMATCH_ASSIGN_OR_RETURN(
      JobSpec spec, ParseCreateJob(request, context.parse, caller.tenant));
  spec.request_sha256 = sha256;
  if (!spec.validate_only) spec.inputs = MakeJobInputs(request);
  return context.manager->Create(caller, std::move(spec), std::move(place));
}

absl::Status Answer(const ServiceContext& context, const Caller& caller,
                    const v1::CreateJobRequest& request,
                    JobManager::Place place, v1::CreateJobResponse& response) {
  ISOMATCH_ASSIGN_OR_RETURN(const JobSnapshot snapshot,
                            Create(context, caller, request, std::move(place)));
  *response.mutable_job() = ToProto(snapshot);
  return absl::OkStatus();
}

}  // namespace

grpc::ServerUnaryReactor* StartCreateJob(const ServiceContext& context,
                                         const Caller& caller,
                                         grpc::CallbackServerContext* call,
                                         const v1::CreateJobRequest* request,
                                         v1::CreateJobResponse* response) {
  grpc::ServerUnaryReactor* reactor = call->DefaultReactor();
  JobManager::Place place;
  if (!request->validate_only()) {
    auto taken = context.manager->TakePlace(caller, request->request_id());
    if (!taken.ok()) {
      reactor->Finish(ToGrpc(taken.status()));
      return reactor;
    }
    place = *std::move(taken);
  }
  const auto bytes = static_cast<std::int64_t>(request->ByteSizeLong());
  auto reserved = context.requests->Reserve(
      std::max(bytes, std::min(kLeastBytes, context.requests->total_bytes())));
  if (!reserved.ok()) {
    reactor->Finish(ToGrpc(UploadQuota(bytes, kRetryUploadQuota)));
    return reactor;
  }
  const auto held =
      std::make_shared<MemoryBudget::Reservation>(*std::move(reserved));
  context.intake->Post([&context, caller, reactor, request, response, held,
                        call, place = std::move(place)]() mutable {
    // Nobody waits for the answer of a call that has ended meanwhile.
    if (call->IsCancelled()) return reactor->Finish(grpc::Status::CANCELLED);
    const absl::Status answered = WithinMemory([&] {
      return Answer(context, caller, *request, std::move(place), *response);
    });
    reactor->Finish(ToGrpc(answered));
  });
  return reactor;
}

}  // namespace isomatch
