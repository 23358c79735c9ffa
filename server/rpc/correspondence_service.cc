#include "server/rpc/correspondence_service.h"

#include <algorithm>
#include <cstdint>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/base/version.h"
#include "server/convert/digest.h"
#include "server/convert/job_name.h"
#include "server/convert/job_proto.h"
#include "server/convert/list_jobs.h"
#include "server/jobs/caller.h"
#include "server/jobs/errors.h"
#include "server/jobs/within_memory.h"
#include "server/rpc/create_job.h"
#include "server/rpc/download_result.h"
#include "server/rpc/grpc_status.h"
#include "server/rpc/raw_message.h"
#include "server/rpc/refused.h"
#include "server/rpc/upload_mesh.h"
#include "server/rpc/watch_job.h"

namespace isomatch {
namespace {

constexpr int kFieldsOfDigest = 3;  // itself, sha256, size_bytes
constexpr int kFieldsOfLabel = 3;   // itself, key, value

/// Bounds of FindMissingMeshes: all digests that there may be, and some more:
/// the error about too many then tells their number.
constexpr RawBounds kDigestsRequest = {
    128 * (RequestLimits::kMaxDigests + 100),
    kFieldsOfDigest*(RequestLimits::kMaxDigests + 100)};

/// Bounds of ListJobs: all labels that a job may have, and states.
constexpr RawBounds kFilterRequest = {
    32 << 10,
    kFieldsOfLabel* static_cast<int>(RequestLimits::kMaxLabels) + 2000};

grpc::ServerUnaryReactor* Finish(grpc::CallbackServerContext* call,
                                 const absl::Status& status) {
  grpc::ServerUnaryReactor* reactor = call->DefaultReactor();
  reactor->Finish(ToGrpc(status));
  return reactor;
}

/// A limit as the API tells it: 0 for none.
template <typename Unsigned, typename Limit>
Unsigned LimitOrZero(Limit limit) {
  return limit == std::numeric_limits<Limit>::max()
             ? 0
             : static_cast<Unsigned>(limit);
}

void SetTenantLimits(const TenantLimits& limits,
                     v1::GetServerInfoResponse::Limits& proto) {
  using Count = std::uint32_t;
  using Bytes = std::uint64_t;
  proto.set_max_queued_jobs_per_tenant(LimitOrZero<Count>(limits.queued_jobs));
  proto.set_max_running_jobs_per_tenant(
      LimitOrZero<Count>(limits.running_jobs));
  proto.set_max_bytes_per_tenant(LimitOrZero<Bytes>(limits.stored_bytes));
  proto.set_max_kept_jobs_per_tenant(LimitOrZero<Count>(limits.kept_jobs));
  proto.set_max_uploads_per_tenant(LimitOrZero<Count>(limits.uploads));
  proto.set_max_upload_bytes_per_tenant(
      LimitOrZero<Bytes>(limits.upload_bytes));
  proto.set_max_requests_per_tenant(LimitOrZero<Count>(limits.requests));
}

void SetLimits(const RequestLimits& limits,
               v1::GetServerInfoResponse::Limits& proto) {
  proto.set_max_request_bytes(
      static_cast<std::uint64_t>(limits.max_request_bytes));
  proto.set_max_chunk_bytes(static_cast<std::uint64_t>(limits.max_chunk_bytes));
  proto.set_max_mesh_bytes(static_cast<std::uint64_t>(limits.max_mesh_bytes));
  proto.set_max_vertices(static_cast<std::uint32_t>(limits.draco.max_vertices));
  proto.set_max_faces(static_cast<std::uint32_t>(limits.draco.max_faces));
  proto.set_max_landmarks(static_cast<std::uint32_t>(limits.max_landmarks));
  proto.set_max_queued_jobs(static_cast<std::uint32_t>(limits.max_queued_jobs));
  SetTenantLimits(limits.tenant, proto);
}

absl::Status FindMissing(const ServiceContext& context, const Caller& caller,
                         const v1::FindMissingMeshesRequest& request,
                         v1::FindMissingMeshesResponse& response) {
  if (request.digests_size() > RequestLimits::kMaxDigests) {
    return InvalidField("digests", absl::StrCat(request.digests_size(),
                                                " of them, expected at most ",
                                                RequestLimits::kMaxDigests));
  }
  std::vector<std::string> asked;
  for (int i = 0; i < request.digests_size(); ++i) {
    ISOMATCH_RETURN_IF_ERROR(ValidateDigest(request.digests(i),
                                            absl::StrCat("digests[", i, "]"),
                                            context.parse.limits));
    asked.push_back(request.digests(i).sha256());
  }
  const auto are_there = context.blobs->AreThere(caller.tenant, asked);
  if (!are_there.ok()) return StorageSilent(are_there.status());
  std::vector<std::string> missing;
  for (int i = 0; i < request.digests_size(); ++i) {
    if ((*are_there)[static_cast<size_t>(i)]) continue;
    *response.add_missing() = request.digests(i);
    missing.push_back(request.digests(i).sha256());
  }
  const std::vector<std::size_t> received =
      context.partial_uploads->ReceivedBytes(caller.tenant, missing);
  for (int i = 0; i < response.missing_size(); ++i) {
    response.add_received_bytes(std::min<std::uint64_t>(
        received[static_cast<size_t>(i)], response.missing(i).size_bytes()));
  }
  return absl::OkStatus();
}

absl::Status Get(const ServiceContext& context, const Caller& caller,
                 const v1::GetJobRequest& request,
                 v1::GetJobResponse& response) {
  ISOMATCH_ASSIGN_OR_RETURN(const std::string id, ParseJobName(request.name()));
  ISOMATCH_ASSIGN_OR_RETURN(const JobSnapshot snapshot,
                            context.manager->Get(caller, id));
  *response.mutable_job() = ToProto(snapshot);
  return absl::OkStatus();
}

absl::Status List(const ServiceContext& context, const Caller& caller,
                  const v1::ListJobsRequest& request,
                  v1::ListJobsResponse& response) {
  ISOMATCH_ASSIGN_OR_RETURN(JobFilter filter, ParseListJobs(request));
  const int page_size = filter.limit;
  ++filter.limit;  // one more tells whether there is a next page
  ISOMATCH_ASSIGN_OR_RETURN(const std::vector<JobSnapshot> jobs,
                            context.manager->List(caller, filter));
  FillPage(jobs, filter, page_size, response);
  return absl::OkStatus();
}

absl::Status Cancel(const ServiceContext& context, const Caller& caller,
                    const v1::CancelJobRequest& request,
                    v1::CancelJobResponse& response) {
  ISOMATCH_ASSIGN_OR_RETURN(const std::string id, ParseJobName(request.name()));
  ISOMATCH_ASSIGN_OR_RETURN(const JobSnapshot snapshot,
                            context.manager->Cancel(caller, id));
  *response.mutable_job() = ToProto(snapshot);
  return absl::OkStatus();
}

absl::Status Delete(const ServiceContext& context, const Caller& caller,
                    const v1::DeleteJobRequest& request,
                    v1::DeleteJobResponse&) {
  ISOMATCH_ASSIGN_OR_RETURN(const std::string id, ParseJobName(request.name()));
  return context.manager->Delete(caller, id);
}

absl::Status Inform(const ServiceContext& context, const Caller& caller,
                    const v1::GetServerInfoRequest&,
                    v1::GetServerInfoResponse& response) {
  const JobLoad load = context.manager->load();
  response.set_version(kVersion);
  SetLimits(context.parse.limits, *response.mutable_limits());
  response.mutable_limits()->set_max_priority(caller.max_priority);
  const WorkerFigures workers = context.manager->workers();
  response.set_workers(static_cast<std::uint32_t>(workers.slots));
  response.set_threads_per_job(static_cast<std::uint32_t>(workers.threads));
  response.set_queued_jobs(static_cast<std::uint32_t>(load.queued_jobs));
  response.set_running_jobs(static_cast<std::uint32_t>(load.running_jobs));
  response.set_memory_budget_bytes(
      static_cast<std::uint64_t>(workers.job_bytes));
  response.set_memory_reserved_bytes(
      static_cast<std::uint64_t>(context.budget->reserved_bytes()));
  response.set_draining(load.draining);
  response.set_durable(context.durable);
  response.mutable_job_retention()->set_seconds(
      absl::ToInt64Seconds(context.job_retention));
  if (context.max_run_time > absl::ZeroDuration()) {
    *response.mutable_max_run_time() = DurationToProto(context.max_run_time);
  }
  response.set_tenant(caller.tenant);
  return absl::OkStatus();
}

/// Calls `answer`; its response goes to `bytes`.
template <typename Request, typename Response>
absl::Status Serialized(absl::Status (*answer)(const ServiceContext&,
                                               const Caller&, const Request&,
                                               Response&),
                        const ServiceContext& context, const Caller& caller,
                        const Request& request, grpc::ByteBuffer* bytes) {
  Response response;
  ISOMATCH_RETURN_IF_ERROR(answer(context, caller, request, response));
  *bytes = SerializeRaw(response);
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<Caller> CorrespondenceService::Read(
    const Context& call, const Admitted& admitted, const Bytes* raw,
    google::protobuf::Message& request) const {
  const Bytes bytes = TakeBytes(raw);
  ISOMATCH_ASSIGN_OR_RETURN(Caller caller,
                            context_.access->Identify(call, admitted.role));
  ISOMATCH_RETURN_IF_ERROR(ParseWithin(admitted.request, bytes, request));
  return caller;
}

template <typename Request, typename Response>
grpc::ServerUnaryReactor* CorrespondenceService::Respond(
    Context* call, const Admitted& admitted, const Bytes* raw, Bytes* response,
    Answer<Request, Response> answer) {
  Request request;
  const auto caller = Read(*call, admitted, raw, request);
  if (!caller.ok()) return Finish(call, caller.status());
  if (context_.reads != nullptr) {
    return Post(*context_.reads, {call, *caller}, request, response, answer);
  }
  return Finish(call, Serialized(answer, context_, *caller, request, response));
}

template <typename Request, typename Response>
grpc::ServerUnaryReactor* CorrespondenceService::RespondInTurn(
    Context* call, const Admitted& admitted, const Bytes* raw, Bytes* response,
    Answer<Request, Response> answer) {
  Request request;
  const auto caller = Read(*call, admitted, raw, request);
  if (!caller.ok()) return Finish(call, caller.status());
  return Post(*context_.changes, {call, *caller}, request, response, answer);
}

template <typename Request, typename Response>
grpc::ServerUnaryReactor* CorrespondenceService::Post(
    TenantTurns& turns, const Asked& asked, const Request& request,
    Bytes* response, Answer<Request, Response> answer) {
  Unary* const reactor = asked.call->DefaultReactor();
  auto task = [this, caller = asked.caller, request, answer, response, reactor,
               call = asked.call] {
    // Nobody waits for the answer of a call that has ended meanwhile.
    if (call->IsCancelled()) return reactor->Finish(grpc::Status::CANCELLED);
    reactor->Finish(ToGrpc(WithinMemory([&] {
      return Serialized(answer, context_, caller, request, response);
    })));
  };
  const absl::Status posted = WithinMemory(
      [&] { return turns.Post(asked.caller.tenant, std::move(task)); });
  if (!posted.ok()) reactor->Finish(ToGrpc(posted));
  return reactor;
}

grpc::ServerUnaryReactor* CorrespondenceService::GetServerInfo(
    Context* call, const Bytes* request, Bytes* response) {
  return Respond(call, {Role::kRead, kSmallRequest}, request, response, Inform);
}

CorrespondenceService::Reader* CorrespondenceService::UploadMesh(
    Context* call, Bytes* response) {
  const auto caller = context_.access->Identify(*call, Role::kSubmit);
  if (!caller.ok()) return new Refused<Reader>(caller.status());
  return StartUploadMesh(context_, caller->tenant, response);
}

grpc::ServerUnaryReactor* CorrespondenceService::FindMissingMeshes(
    Context* call, const Bytes* request, Bytes* response) {
  return Respond(call, {Role::kRead, kDigestsRequest}, request, response,
                 FindMissing);
}

grpc::ServerUnaryReactor* CorrespondenceService::CreateJob(Context* call,
                                                           const Bytes* request,
                                                           Bytes* response) {
  const auto caller = context_.access->Identify(*call, Role::kSubmit);
  if (!caller.ok()) return Finish(call, caller.status());
  return StartCreateJob(context_, *caller, call, request, response);
}

grpc::ServerUnaryReactor* CorrespondenceService::GetJob(Context* call,
                                                        const Bytes* request,
                                                        Bytes* response) {
  return Respond(call, {Role::kRead, kSmallRequest}, request, response, Get);
}

CorrespondenceService::Writer* CorrespondenceService::WatchJob(
    Context* call, const Bytes* raw) {
  v1::WatchJobRequest request;
  const auto caller = Read(*call, {Role::kRead, kSmallRequest}, raw, request);
  if (!caller.ok()) return new Refused<Writer>(caller.status());
  return StartWatchJob(context_, *caller, request);
}

grpc::ServerUnaryReactor* CorrespondenceService::ListJobs(Context* call,
                                                          const Bytes* request,
                                                          Bytes* response) {
  return Respond(call, {Role::kRead, kFilterRequest}, request, response, List);
}

grpc::ServerUnaryReactor* CorrespondenceService::CancelJob(Context* call,
                                                           const Bytes* request,
                                                           Bytes* response) {
  return RespondInTurn(call, {Role::kSubmit, kSmallRequest}, request, response,
                       Cancel);
}

grpc::ServerUnaryReactor* CorrespondenceService::DeleteJob(Context* call,
                                                           const Bytes* request,
                                                           Bytes* response) {
  return RespondInTurn(call, {Role::kSubmit, kSmallRequest}, request, response,
                       Delete);
}

CorrespondenceService::Writer* CorrespondenceService::DownloadResult(
    Context* call, const Bytes* raw) {
  v1::DownloadResultRequest request;
  auto caller = Read(*call, {Role::kRead, kSmallRequest}, raw, request);
  if (!caller.ok()) return new Refused<Writer>(caller.status());
  return StartDownloadResult(context_, *std::move(caller), std::move(request));
}

}  // namespace isomatch
