#pragma once

#include <string>

#include <grpcpp/support/status.h>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"

namespace isomatch {

/// Returns what a call ended with. The message tells field violations and the
/// reason that came along as google.rpc details, e.g. "... (QUEUE_FULL)".
absl::Status FromGrpc(const grpc::Status& status);

/// The SHA-256 of `bytes`, 64 lower-case hexadecimal digits.
std::string HexSha256(absl::string_view bytes);

/// A random UUID (version 4), different for every call.
std::string RandomUuid();

}  // namespace isomatch
