#include "server/rpc/correspondence_service.h"

#include <algorithm>
#include <cstdint>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include <grpcpp/support/proto_buffer_reader.h>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/base/version.h"
#include "server/convert/digest.h"
#include "server/convert/job_name.h"
#include "server/convert/job_proto.h"
#include "server/convert/list_jobs.h"
#include "server/convert/request_outline.h"
#include "server/jobs/caller.h"
#include "server/jobs/errors.h"
#include "server/rpc/create_job.h"
#include "server/rpc/download_result.h"
#include "server/rpc/grpc_status.h"
#include "server/rpc/raw_message.h"
#include "server/rpc/refused.h"
#include "server/rpc/upload_mesh.h"
#include "server/rpc/watch_job.h"

namespace isomatch {
namespace {

grpc::ServerUnaryReactor* Finish(grpc::CallbackServerContext* call,
                                 const absl::Status& status) {
  grpc::ServerUnaryReactor* reactor = call->DefaultReactor();
  reactor->Finish(ToGrpc(status));
  return reactor;
}

/// Those that there are: 0 stands for none.
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

absl::Status FindMissing(const v1::FindMissingMeshesRequest& request,
                         const ServiceContext& context, const Caller& caller,
                         v1::FindMissingMeshesResponse& response) {
  if (request.digests_size() > RequestLimits::kMaxDigests) {
    return InvalidField("digests", absl::StrCat(request.digests_size(),
                                                " of them, expected at most ",
                                                RequestLimits::kMaxDigests));
  }
  for (int i = 0; i < request.digests_size(); ++i) {
    const v1::Digest& digest = request.digests(i);
    ISOMATCH_RETURN_IF_ERROR(ValidateDigest(
        digest, absl::StrCat("digests[", i, "]"), context.parse.limits));
    const BlobKey key = {caller.tenant, digest.sha256()};
    if (context.blobs->Has(key)) continue;
    *response.add_missing() = digest;
    const std::uint64_t received = context.partial_uploads->ReceivedBytes(key);
    response.add_received_bytes(std::min(received, digest.size_bytes()));
  }
  return absl::OkStatus();
}

absl::Status FindMissingRaw(const grpc::ByteBuffer& raw,
                            const ServiceContext& context, const Caller& caller,
                            grpc::ByteBuffer& response) {
  constexpr int kFieldsOfDigest = 3;  // itself, sha256, size_bytes
  constexpr int kMaxFields = kFieldsOfDigest * (RequestLimits::kMaxDigests + 1);
  grpc::ByteBuffer bytes = raw;  // shares them
  grpc::ProtoBufferReader reader(&bytes);
  ISOMATCH_RETURN_IF_ERROR(CheckFieldCount(
      reader, *v1::FindMissingMeshesRequest::descriptor(), kMaxFields));
  v1::FindMissingMeshesRequest request;
  if (!ParseRaw(raw, request)) {
    return InvalidField("request", "expected a FindMissingMeshesRequest");
  }
  v1::FindMissingMeshesResponse found;
  ISOMATCH_RETURN_IF_ERROR(FindMissing(request, context, caller, found));
  response = SerializeRaw(found);
  return absl::OkStatus();
}

absl::Status Get(const v1::GetJobRequest& request, const Caller& caller,
                 const JobManager& manager, v1::GetJobResponse& response) {
  ISOMATCH_ASSIGN_OR_RETURN(const std::string id, ParseJobName(request.name()));
  ISOMATCH_ASSIGN_OR_RETURN(const JobSnapshot snapshot,
                            manager.Get(caller, id));
  *response.mutable_job() = ToProto(snapshot);
  return absl::OkStatus();
}

absl::Status List(const v1::ListJobsRequest& request, const Caller& caller,
                  const JobManager& manager, v1::ListJobsResponse& response) {
  ISOMATCH_ASSIGN_OR_RETURN(JobFilter filter, ParseListJobs(request));
  const int page_size = filter.limit;
  ++filter.limit;  // one more tells whether there is a next page
  FillPage(manager.List(caller, filter), filter, page_size, response);
  return absl::OkStatus();
}

absl::Status Cancel(const v1::CancelJobRequest& request, const Caller& caller,
                    JobManager& manager, v1::CancelJobResponse& response) {
  ISOMATCH_ASSIGN_OR_RETURN(const std::string id, ParseJobName(request.name()));
  ISOMATCH_ASSIGN_OR_RETURN(const JobSnapshot snapshot,
                            manager.Cancel(caller, id));
  *response.mutable_job() = ToProto(snapshot);
  return absl::OkStatus();
}

absl::Status Delete(const v1::DeleteJobRequest& request, const Caller& caller,
                    JobManager& manager) {
  ISOMATCH_ASSIGN_OR_RETURN(const std::string id, ParseJobName(request.name()));
  return manager.Delete(caller, id);
}

void SetInformation(const ServiceContext& context, const Caller& caller,
                    v1::GetServerInfoResponse& response) {
  const JobManager::Load load = context.manager->load();
  response.set_version(kVersion);
  SetLimits(context.parse.limits, *response.mutable_limits());
  response.mutable_limits()->set_max_priority(caller.max_priority);
  response.set_workers(static_cast<std::uint32_t>(context.workers));
  response.set_threads_per_job(
      static_cast<std::uint32_t>(context.parse.threads_per_job));
  response.set_queued_jobs(static_cast<std::uint32_t>(load.queued_jobs));
  response.set_running_jobs(static_cast<std::uint32_t>(load.running_jobs));
  response.set_memory_budget_bytes(
      static_cast<std::uint64_t>(context.budget->total_bytes()));
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
}

}  // namespace

template <typename Answer>
grpc::ServerUnaryReactor* CorrespondenceService::Respond(
    grpc::CallbackServerContext* call, Role needed, const Answer& answer) {
  const auto caller = context_.access->Identify(*call, needed);
  return Finish(call, caller.ok() ? answer(*caller) : caller.status());
}

grpc::ServerUnaryReactor* CorrespondenceService::GetServerInfo(
    grpc::CallbackServerContext* call, const v1::GetServerInfoRequest*,
    v1::GetServerInfoResponse* response) {
  return Respond(call, Role::kRead, [&](const Caller& caller) {
    SetInformation(context_, caller, *response);
    return absl::OkStatus();
  });
}

grpc::ServerReadReactor<v1::UploadMeshRequest>*
CorrespondenceService::UploadMesh(grpc::CallbackServerContext* call,
                                  v1::UploadMeshResponse* response) {
  const auto caller = context_.access->Identify(*call, Role::kSubmit);
  if (!caller.ok()) {
    return new Refused<grpc::ServerReadReactor<v1::UploadMeshRequest>>(
        caller.status());
  }
  return StartUploadMesh(context_, caller->tenant, response);
}

grpc::ServerUnaryReactor* CorrespondenceService::FindMissingMeshes(
    grpc::CallbackServerContext* call, const grpc::ByteBuffer* request,
    grpc::ByteBuffer* response) {
  return Respond(call, Role::kRead, [&](const Caller& caller) {
    return FindMissingRaw(*request, context_, caller, *response);
  });
}

grpc::ServerUnaryReactor* CorrespondenceService::CreateJob(
    grpc::CallbackServerContext* call, const grpc::ByteBuffer* request,
    grpc::ByteBuffer* response) {
  const auto caller = context_.access->Identify(*call, Role::kSubmit);
  if (!caller.ok()) return Finish(call, caller.status());
  return StartCreateJob(context_, *caller, call, request, response);
}

grpc::ServerUnaryReactor* CorrespondenceService::GetJob(
    grpc::CallbackServerContext* call, const v1::GetJobRequest* request,
    v1::GetJobResponse* response) {
  return Respond(call, Role::kRead, [&](const Caller& caller) {
    return Get(*request, caller, *context_.manager, *response);
  });
}

grpc::ServerWriteReactor<v1::WatchJobResponse>* CorrespondenceService::WatchJob(
    grpc::CallbackServerContext* call, const v1::WatchJobRequest* request) {
  const auto caller = context_.access->Identify(*call, Role::kRead);
  if (!caller.ok()) {
    return new Refused<grpc::ServerWriteReactor<v1::WatchJobResponse>>(
        caller.status());
  }
  return StartWatchJob(context_, *caller, *request);
}

grpc::ServerUnaryReactor* CorrespondenceService::ListJobs(
    grpc::CallbackServerContext* call, const v1::ListJobsRequest* request,
    v1::ListJobsResponse* response) {
  return Respond(call, Role::kRead, [&](const Caller& caller) {
    return List(*request, caller, *context_.manager, *response);
  });
}

grpc::ServerUnaryReactor* CorrespondenceService::CancelJob(
    grpc::CallbackServerContext* call, const v1::CancelJobRequest* request,
    v1::CancelJobResponse* response) {
  return Respond(call, Role::kSubmit, [&](const Caller& caller) {
    return Cancel(*request, caller, *context_.manager, *response);
  });
}

grpc::ServerUnaryReactor* CorrespondenceService::DeleteJob(
    grpc::CallbackServerContext* call, const v1::DeleteJobRequest* request,
    v1::DeleteJobResponse*) {
  return Respond(call, Role::kSubmit, [&](const Caller& caller) {
    return Delete(*request, caller, *context_.manager);
  });
}

grpc::ServerWriteReactor<v1::DownloadResultResponse>*
CorrespondenceService::DownloadResult(
    grpc::CallbackServerContext* call,
    const v1::DownloadResultRequest* request) {
  const auto caller = context_.access->Identify(*call, Role::kRead);
  if (!caller.ok()) {
    return new Refused<grpc::ServerWriteReactor<v1::DownloadResultResponse>>(
        caller.status());
  }
  return StartDownloadResult(context_, *caller, *request);
}

}  // namespace isomatch
