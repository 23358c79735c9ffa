#pragma once

#include <functional>
#include <memory>
#include <string>

#include <grpcpp/support/server_interceptor.h>

#include "absl/time/time.h"
#include "server/metrics/metrics.h"

namespace isomatch {

/// What watches the calls of a server works with. All of it outlives the
/// gRPC server.
struct CallObservation {
  Metrics* metrics = &NullMetrics();
  /// Whether finished calls are logged: at debug level, errors at info.
  bool log = false;
  std::function<absl::Time()> now;
  /// Returns a request id for a call that brought none.
  std::function<std::string()> new_id;
};

/// Returns the maker of interceptors that, for each call,
///
///   1. take its request id from the metadata "x-request-id" if that is 1 to
///      128 of A-Z a-z 0-9 . _ -, else make one, leave it there for the handler
///      of the call (CallIdOf), and send it back in the initial metadata;
///   2. count the call, by method and code, when the status is sent;
///   3. log it then, with duration, peer, request id, the job it is about and
///      the client's "traceparent" if that is a W3C one.
///
/// No other metadata is read, so none can leak.
std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface>
MakeCallInterceptors(CallObservation observation);

}  // namespace isomatch
