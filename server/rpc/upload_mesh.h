#pragma once

#include <grpcpp/support/server_callback.h>

#include "isomatch/v1/service.pb.h"
#include "server/rpc/service_context.h"

namespace isomatch {

/// Takes one mesh of the caller in chunks and stores it; see service.proto.
grpc::ServerReadReactor<v1::UploadMeshRequest>* StartUploadMesh(
    const ServiceContext& context, const Caller& caller,
    v1::UploadMeshResponse* response);

}  // namespace isomatch
