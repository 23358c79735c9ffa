#include "server/rpc/grpc_logging.h"

#include <grpc/support/log.h>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "server/logging/log.h"

namespace isomatch {
namespace {

LogLevel LevelOf(gpr_log_severity severity) {
  // Errors are those of a peer or a socket, seldom ours.
  return severity == GPR_LOG_SEVERITY_ERROR ? LogLevel::kWarning
                                            : LogLevel::kDebug;
}

bool MayHoldAKey(const char* message) {
  const std::string lower = absl::AsciiStrToLower(message);
  return absl::StrContains(lower, "authorization") ||
         absl::StrContains(lower, "api-key");
}

}  // namespace

void RouteGrpcLog() {
  gpr_set_log_function([](gpr_log_func_args* entry) {
    const LogLevel level = LevelOf(entry->severity);
    if (!ShouldLog(level)) return;
    Log(level, MayHoldAKey(entry->message)
                   ? "grpc: a line that may hold a key is left out"
                   : absl::StrCat("grpc: ", entry->message));
  });
}

}  // namespace isomatch
