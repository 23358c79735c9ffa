#pragma once

namespace isomatch {

/// Sends gRPC's own log to ours, for the whole process. A line that may quote
/// metadata with a key is left out.
void RouteGrpcLog();

}  // namespace isomatch
