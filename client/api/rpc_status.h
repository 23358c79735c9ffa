#pragma once

#include <string>

#include <grpcpp/support/status.h>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"

namespace isomatch {

/// Returns what a call ended with. The message tells field violations and the
/// reason that came along as google.rpc details, e.g. "... (QUEUE_FULL)".
absl::Status FromGrpc(const grpc::Status& status);

/// `status` with a reason of proto/README.md, which the message tells, too.
absl::Status WithReason(const absl::Status& status, absl::string_view reason);

/// The reason of an error, e.g. "QUEUE_FULL"; "" for an error without one.
std::string ErrorReason(const absl::Status& status);

/// A random UUID (version 4), different for every call.
std::string RandomUuid();

}  // namespace isomatch
