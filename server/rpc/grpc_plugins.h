#pragma once

#include <grpcpp/server_builder.h>

namespace isomatch {

/// Gives health checking and reflection to all servers of the process, once:
/// gRPC takes plugins globally.
void InitGrpcPlugins();

/// Takes reflection from a server that is built.
void TakeReflection(grpc::ServerBuilder& builder);

}  // namespace isomatch
