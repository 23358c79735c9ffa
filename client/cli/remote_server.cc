#include "client/cli/remote_server.h"

#include <cstdlib>
#include <string>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "client/api/connection.h"
#include "client/api/rpc_status.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

// Instead of gRPC's text about a connection that was not made. A server that
// answered gave its reason, and may speak of connections of its own.
std::string ConnectionTrouble(const absl::Status& status) {
  constexpr char kWhatToDo[] =
      "; start isomatch-server, or name another by --server or ISOMATCH_SERVER";
  const std::string text(status.message());
  if (!ErrorReason(status).empty()) return text;
  if (absl::StrContains(text, "Connection refused")) {
    return absl::StrCat("nobody listens there (connection refused)", kWhatToDo);
  }
  if (absl::StrContains(text, "No such file")) {
    return absl::StrCat("there is no such socket", kWhatToDo);
  }
  if (absl::StrContains(text, "DNS resolution failed") ||
      absl::StrContains(text, "Domain name not found")) {
    return absl::StrCat("there is no host of this name", kWhatToDo);
  }
  if (absl::StrContains(text, "failed to connect to all addresses")) {
    return absl::StrCat(text, kWhatToDo);
  }
  return text;
}

}  // namespace

absl::StatusOr<RemoteServer> RemoteServer::Open(const ConnectionFlags& flags,
                                                const Terminal& terminal) {
  ISOMATCH_ASSIGN_OR_RETURN(
      const ConnectionSecurity security,
      LoadSecurity(flags, std::getenv("ISOMATCH_API_KEY")));
  ISOMATCH_ASSIGN_OR_RETURN(const absl::Duration patience,
                            ParsePatience(flags));
  Warn(SecurityWarnings(flags, security), terminal);
  return RemoteServer(flags.server, ConnectTo(flags.server, security),
                      patience);
}

absl::StatusOr<RemoteServer> RemoteServer::Contact(const ConnectionFlags& flags,
                                                   const Terminal& terminal) {
  ISOMATCH_ASSIGN_OR_RETURN(RemoteServer server, Open(flags, terminal));
  const auto info = server.client().GetServerInfo(terminal.stop);
  if (!info.ok()) return server.Explain(info.status());
  return server;
}

absl::Status RemoteServer::Explain(const absl::Status& status) const {
  switch (status.code()) {
    case absl::StatusCode::kUnavailable:
      return absl::UnavailableError(
          absl::StrCat("--server ", address_, ": ", ConnectionTrouble(status)));
    case absl::StatusCode::kUnauthenticated:
      return absl::UnauthenticatedError(
          absl::StrCat("--server ", address_, ": ", status.message(),
                       ", expected --api-key-file or ISOMATCH_API_KEY"));
    default:
      return status;
  }
}

}  // namespace isomatch
