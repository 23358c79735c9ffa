#pragma once

#include <grpcpp/support/server_callback.h>

#include "isomatch/v1/service.pb.h"
#include "server/rpc/service_context.h"

namespace isomatch {

/// Streams a part of the result of a job that the caller may see: the header,
/// then chunks from the offset on.
grpc::ServerWriteReactor<v1::DownloadResultResponse>* StartDownloadResult(
    const ServiceContext& context, const Caller& caller,
    const v1::DownloadResultRequest& request);

}  // namespace isomatch
