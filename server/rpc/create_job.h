#pragma once

#include <grpcpp/support/server_callback.h>

#include "isomatch/v1/service.pb.h"
#include "server/rpc/service_context.h"

namespace isomatch {

/// Decodes, checks and accepts the caller's job on the intake executor, then
/// finishes the call. `request` and `response` live until then. A request whose
/// request_id is known is answered without looking at its meshes.
grpc::ServerUnaryReactor* StartCreateJob(const ServiceContext& context,
                                         const Caller& caller,
                                         grpc::CallbackServerContext* call,
                                         const v1::CreateJobRequest* request,
                                         v1::CreateJobResponse* response);

}  // namespace isomatch
