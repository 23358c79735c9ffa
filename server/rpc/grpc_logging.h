#pragma once

namespace isomatch {

/// Sends gRPC's own log to spdlog's default logger, for the whole process.
void RouteGrpcLogToSpdlog();

}  // namespace isomatch
