#pragma once

#include <grpcpp/support/server_callback.h>

#include "isomatch/v1/service.pb.h"
#include "server/rpc/service_context.h"

namespace isomatch {

/// Streams snapshots of a job that the caller may see until it is terminal; see
/// service.proto.
grpc::ServerWriteReactor<grpc::ByteBuffer>* StartWatchJob(
    const ServiceContext& context, const Caller& caller,
    const v1::WatchJobRequest& request);

}  // namespace isomatch
