#pragma once

#include <cstddef>

#include <grpcpp/server_builder.h>

#include "server/convert/request_limits.h"

namespace isomatch {

/// What gRPC may hold for all its connections.
inline constexpr std::size_t kGrpcBytes = std::size_t{512} << 20;

/// Sets what gRPC's server allows its peers: how large a message is, how many
/// streams and how long a connection has, and that nothing is compressed.
void SetChannelArguments(const RequestLimits& limits,
                         grpc::ServerBuilder& builder);

}  // namespace isomatch
