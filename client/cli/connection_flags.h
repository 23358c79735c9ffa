#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "client/api/connection.h"

namespace CLI {
class App;
}  // namespace CLI

namespace isomatch {

/// Which server, and the files that prove who is who; empty when not given.
struct ConnectionFlags {
  std::string server;
  std::string tls_ca;
  std::string tls_cert;
  std::string tls_key;
  std::string api_key_file;
  std::string patience = "10s";
};

/// Where a server listens when nothing else is said.
inline constexpr char kDefaultServer[] = "127.0.0.1:7443";

enum class ServerUse {
  /// Without --server the command does the work itself.
  kOptional,
  /// Without --server it is kDefaultServer.
  kNeeded,
};

/// Adds --server, which the environment's ISOMATCH_SERVER can give too, and
/// what belongs to it. `flags` outlives `command`.
void AddConnectionFlags(CLI::App* command, ConnectionFlags* flags,
                        ServerUse use);

/// Returns what the files hold. Without --api-key-file the key is
/// `environment_key` (of ISOMATCH_API_KEY; null and "" mean none).
///
/// INVALID_ARGUMENT, NOT_FOUND: a file is missing, not readable, not PEM, or
/// has not one key. No message has any of a key.
absl::StatusOr<ConnectionSecurity> LoadSecurity(const ConnectionFlags& flags,
                                                const char* environment_key);

/// How long calls are repeated while the server is away. INVALID_ARGUMENT: it
/// is no duration.
absl::StatusOr<absl::Duration> ParsePatience(const ConnectionFlags& flags);

/// What the user should know: a key that travels unencrypted to another
/// machine.
std::vector<std::string> SecurityWarnings(const ConnectionFlags& flags,
                                          const ConnectionSecurity& security);

}  // namespace isomatch
