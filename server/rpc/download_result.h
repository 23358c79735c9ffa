#pragma once

#include <grpcpp/support/server_callback.h>

#include "isomatch/v1/service.pb.h"
#include "server/rpc/service_context.h"

namespace isomatch {

/// Streams a part of the result of a job that the caller may see: the header,
/// then chunks from the offset on. The part is read when it is the tenant's
/// turn, and takes of what the tenant may have in memory until it is sent.
grpc::ServerWriteReactor<grpc::ByteBuffer>* StartDownloadResult(
    const ServiceContext& context, Caller caller,
    v1::DownloadResultRequest request);

}  // namespace isomatch
