#pragma once

#include <string>

#include <grpcpp/support/status.h>

#include "absl/status/status.h"

namespace isomatch {

/// Returns what a call ended with. The message tells field violations and the
/// reason that came along as google.rpc details, e.g. "... (QUEUE_FULL)".
absl::Status FromGrpc(const grpc::Status& status);

/// A random UUID (version 4), different for every call.
std::string RandomUuid();

}  // namespace isomatch
