#include "server/rpc/create_job.h"

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include <grpcpp/server_context.h>

#include "core/base/status_macros.h"
#include "server/convert/job_proto.h"
#include "server/convert/stored_request.h"
#include "server/jobs/within_memory.h"
#include "server/rpc/grpc_status.h"

namespace isomatch {
namespace {

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
  auto reserved = context.partial_uploads->Reserve(bytes);
  if (!reserved.ok()) {
    reactor->Finish(ToGrpc(reserved.status()));
    return reactor;
  }
  const auto held =
      std::make_shared<MemoryBudget::Reservation>(*std::move(reserved));
  context.intake->Post([&context, caller, reactor, request, response, held,
                        place = std::move(place)]() mutable {
    const absl::Status answered = WithinMemory([&] {
      return Answer(context, caller, *request, std::move(place), *response);
    });
    reactor->Finish(ToGrpc(answered));
  });
  return reactor;
}

}  // namespace isomatch
