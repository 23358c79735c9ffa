#pragma once

#include <grpcpp/support/byte_buffer.h>
#include <grpcpp/support/server_callback.h>

#include "server/rpc/service_context.h"

namespace isomatch {

/// Reads, checks and accepts the caller's job when it is the tenant's turn,
/// then finishes the call. `request` and `response` live until then: a
/// CreateJobRequest, which is not parsed before, and a CreateJobResponse. A
/// request whose request_id is known is answered without looking at its meshes.
grpc::ServerUnaryReactor* StartCreateJob(const ServiceContext& context,
                                         const Caller& caller,
                                         grpc::CallbackServerContext* call,
                                         const grpc::ByteBuffer* request,
                                         grpc::ByteBuffer* response);

}  // namespace isomatch
