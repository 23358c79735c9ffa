#include "server/rpc/grpc_logging.h"

#include <grpc/support/log.h>
#include <spdlog/spdlog.h>

namespace isomatch {
namespace {

spdlog::level::level_enum LevelOf(gpr_log_severity severity) {
  switch (severity) {
    case GPR_LOG_SEVERITY_ERROR:
      return spdlog::level::warn;  // of a peer or a socket, seldom of ours
    case GPR_LOG_SEVERITY_INFO:
    case GPR_LOG_SEVERITY_DEBUG:
      return spdlog::level::debug;
  }
  return spdlog::level::debug;
}

}  // namespace

void RouteGrpcLogToSpdlog() {
  gpr_set_log_function([](gpr_log_func_args* entry) {
    spdlog::log(LevelOf(entry->severity), "grpc: {}", entry->message);
  });
}

}  // namespace isomatch
