#pragma once

#include <grpcpp/support/status.h>

#include "absl/status/status.h"

namespace isomatch {

/// Returns the same error for gRPC, its details as ErrorInfo, BadRequest and
/// RetryInfo in a google.rpc.Status (trailer grpc-status-details-bin).
grpc::Status ToGrpc(const absl::Status& status);

}  // namespace isomatch
