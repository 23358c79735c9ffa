#include "client/remote_server.h"

#include <cstdlib>
#include <utility>

#include "absl/strings/str_cat.h"
#include "client/connection.h"
#include "core/base/status_macros.h"

namespace isomatch {

absl::StatusOr<RemoteServer> RemoteServer::Open(const ConnectionFlags& flags,
                                                const Terminal& terminal) {
  ISOMATCH_ASSIGN_OR_RETURN(
      const ConnectionSecurity security,
      LoadSecurity(flags, std::getenv("ISOMATCH_API_KEY")));
  Warn(SecurityWarnings(flags, security), terminal);
  return RemoteServer(flags.server, ConnectTo(flags.server, security));
}

absl::Status RemoteServer::Explain(const absl::Status& status) const {
  switch (status.code()) {
    case absl::StatusCode::kUnavailable:
      return absl::UnavailableError(
          absl::StrCat("--server ", address_, ": ", status.message()));
    case absl::StatusCode::kUnauthenticated:
      return absl::UnauthenticatedError(
          absl::StrCat("--server ", address_, ": ", status.message(),
                       ", expected --api-key-file or ISOMATCH_API_KEY"));
    default:
      return status;
  }
}

}  // namespace isomatch
