#pragma once

#include <optional>

#include "server/server_config.h"

namespace isomatch {

/// Reads the command line of isomatch-server into `config`. Returns nullopt to
/// go on, or the exit status: 0 after --help, --version or --new-api-key, 2 for
/// wrong flags, about which standard error has been told.
std::optional<int> ParseServerFlags(int argc, const char* const* argv,
                                    ServerConfig& config);

}  // namespace isomatch
