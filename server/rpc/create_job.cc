#include "server/rpc/create_job.h"

#include <algorithm>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include <grpcpp/server_context.h>
#include <grpcpp/support/proto_buffer_reader.h>

#include "core/base/status_macros.h"
#include "isomatch/v1/service.pb.h"
#include "server/convert/job_proto.h"
#include "server/convert/request_outline.h"
#include "server/convert/stored_request.h"
#include "server/jobs/errors.h"
#include "server/jobs/within_memory.h"
#include "server/rpc/grpc_status.h"
#include "server/rpc/raw_message.h"

namespace isomatch {
namespace {

/// The least bytes that a waiting request reserves, so that not too many small
/// ones wait: the queue does not limit those with `validate_only`, which take
/// no seat in it.
constexpr std::int64_t kLeastBytes = 16 << 10;

absl::StatusOr<JobSnapshot> Create(const ServiceContext& context,
                                   const Caller& caller,
                                   v1::CreateJobRequest request,
                                   JobIntake::SeatPtr seat) {
  const std::string sha256 =
      request.request_id().empty() ? "" : RequestSha256(request);
  ISOMATCH_ASSIGN_OR_RETURN(
      const std::optional<JobSnapshot> before,
      context.manager->FindRequest(caller, request.request_id(), sha256));
  if (before) return *before;
  ISOMATCH_ASSIGN_OR_RETURN(
      JobSpec spec, ParseCreateJob(request, context.parse, caller.tenant));
  spec.request_sha256 = sha256;
  if (!spec.validate_only) SetInputs(caller.tenant, std::move(request), spec);
  return context.manager->Create(caller, std::move(spec), std::move(seat));
}

absl::Status Answer(const ServiceContext& context, const Caller& caller,
                    const grpc::ByteBuffer& raw, JobIntake::SeatPtr seat,
                    grpc::ByteBuffer& response) {
  v1::CreateJobRequest request;
  if (!ParseRaw(raw, request)) {
    return InvalidField("request", "expected a message CreateJobRequest");
  }
  ISOMATCH_ASSIGN_OR_RETURN(
      const JobSnapshot snapshot,
      Create(context, caller, std::move(request), std::move(seat)));
  v1::CreateJobResponse created;
  *created.mutable_job() = ToProto(snapshot);
  response = SerializeRaw(created);
  return absl::OkStatus();
}

/// Checks a request and reads its outline, before it waits and before anything
/// is reserved for it.
absl::StatusOr<RequestOutline> Outline(const ServiceContext& context,
                                       const grpc::ByteBuffer& request) {
  grpc::ByteBuffer bytes = request;  // shares them
  grpc::ProtoBufferReader counted(&bytes);
  ISOMATCH_RETURN_IF_ERROR(
      CheckFieldCount(counted, *v1::CreateJobRequest::descriptor(),
                      MaxCreateJobFields(context.parse.limits.max_landmarks)));
  bytes = request;
  grpc::ProtoBufferReader reader(&bytes);
  return ReadOutline(reader);
}

/// Reserves room for a request that waits.
absl::StatusOr<MemoryBudget::Reservation> ReserveRequest(
    const ServiceContext& context, const Caller& caller,
    const grpc::ByteBuffer& request) {
  MemoryBudget& room = context.requests->Of(caller.tenant);
  const auto bytes = static_cast<std::int64_t>(request.Length());
  auto reserved =
      room.Reserve(std::max(bytes, std::min(kLeastBytes, room.total_bytes())));
  if (reserved.ok()) return reserved;
  return TenantUploadQuota(caller.tenant, bytes, room.total_bytes(),
                           kRetryUploadQuota);
}

/// What a request holds from its arrival until it is answered.
struct Waiting {
  RequestOutline outline;
  JobIntake::SeatPtr seat;
  MemoryBudget::Reservation room;
};

absl::Status TakeSeat(const ServiceContext& context, const Caller& caller,
                      Waiting& waiting) {
  if (waiting.outline.validate_only) return absl::OkStatus();
  ISOMATCH_ASSIGN_OR_RETURN(
      waiting.seat,
      context.manager->TakeSeat(caller, waiting.outline.request_id));
  return absl::OkStatus();
}

/// Whether that waits for a database, which gRPC's threads must not do.
bool SeatsAreInADatabase(const ServiceContext& context) {
  return context.reads != nullptr;
}

absl::StatusOr<std::shared_ptr<Waiting>> TakeIn(
    const ServiceContext& context, const Caller& caller,
    const grpc::ByteBuffer& request) {
  const auto waiting = std::make_shared<Waiting>();
  ISOMATCH_ASSIGN_OR_RETURN(waiting->outline, Outline(context, request));
  if (!SeatsAreInADatabase(context)) {
    ISOMATCH_RETURN_IF_ERROR(TakeSeat(context, caller, *waiting));
  }
  ISOMATCH_ASSIGN_OR_RETURN(waiting->room,
                            ReserveRequest(context, caller, request));
  return waiting;
}

absl::Status AnswerWaiting(const ServiceContext& context, const Caller& caller,
                           const grpc::ByteBuffer& request, Waiting& waiting,
                           grpc::ByteBuffer& response) {
  if (SeatsAreInADatabase(context)) {
    ISOMATCH_RETURN_IF_ERROR(TakeSeat(context, caller, waiting));
  }
  return Answer(context, caller, request, std::move(waiting.seat), response);
}

}  // namespace

grpc::ServerUnaryReactor* StartCreateJob(const ServiceContext& context,
                                         const Caller& caller,
                                         grpc::CallbackServerContext* call,
                                         const grpc::ByteBuffer* request,
                                         grpc::ByteBuffer* response) {
  grpc::ServerUnaryReactor* const reactor = call->DefaultReactor();
  auto taken = TakeIn(context, caller, *request);
  if (!taken.ok()) {
    reactor->Finish(ToGrpc(taken.status()));
    return reactor;
  }
  const absl::Status posted = context.intake->Post(
      caller.tenant, [&context, caller, reactor, request, response, call,
                      waiting = *std::move(taken)]() mutable {
        // Nobody waits for the answer of a call that has ended meanwhile.
        if (call->IsCancelled()) {
          return reactor->Finish(grpc::Status::CANCELLED);
        }
        const absl::Status answered = WithinMemory([&] {
          return AnswerWaiting(context, caller, *request, *waiting, *response);
        });
        reactor->Finish(ToGrpc(answered));
      });
  if (!posted.ok()) reactor->Finish(ToGrpc(posted));
  return reactor;
}

}  // namespace isomatch
