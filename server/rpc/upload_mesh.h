#pragma once

#include <string>

#include <grpcpp/support/server_callback.h>

#include "isomatch/v1/service.pb.h"
#include "server/rpc/service_context.h"

namespace isomatch {

/// Takes one mesh of a tenant in chunks and stores it; see service.proto. At
/// most as many of a tenant at a time as it may have.
grpc::ServerReadReactor<grpc::ByteBuffer>* StartUploadMesh(
    const ServiceContext& context, const std::string& tenant,
    grpc::ByteBuffer* response);

}  // namespace isomatch
