#pragma once

#include <optional>
#include <string>

#include "server/config/server_config.h"

namespace isomatch {

/// What isomatch-server is to do.
struct ServerCommand {
  /// How to serve; valid.
  ServerConfig config;
  /// Do not serve: ask the server at this address how it is (--health).
  std::optional<std::string> health_address;
  /// Do not serve: bring the tables of config.store up to date (migrate).
  bool migrate = false;
};

/// Reads command line, environment and configuration file of isomatch-server
/// into `command`. Returns nullopt to go on, or the exit status: 0 after
/// --help, --version, --print-config or --new-api-key, 2 for wrong values,
/// about which standard error has been told.
std::optional<int> ParseServerFlags(int argc, const char* const* argv,
                                    ServerCommand& command);

}  // namespace isomatch
