#pragma once

#include <grpcpp/support/server_callback.h>

#include "isomatch/v1/service.pb.h"
#include "server/rpc/service_context.h"

namespace isomatch {

/// Takes one mesh in chunks and stores it; see service.proto.
grpc::ServerReadReactor<v1::UploadMeshRequest>* StartUploadMesh(
    const ServiceContext& context, v1::UploadMeshResponse* response);

}  // namespace isomatch
