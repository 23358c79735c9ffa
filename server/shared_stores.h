#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/config/server_config.h"
#include "server/stores.h"

namespace isomatch {

/// Opens the stores of a configuration: of the database config.store, if it has
/// one, else as OpenStores. UNAVAILABLE: it does not answer, or refuses the
/// user; FAILED_PRECONDITION: its tables are not those of this program.
absl::StatusOr<Stores> OpenAnyStores(const ServerConfig& config);

/// Makes the tables of the database config.store, or brings them up to date.
/// Returns a sentence that says which database that is, and what it had and
/// has. Errors as OpenAnyStores.
absl::StatusOr<std::string> MigrateStore(const ServerConfig& config);

}  // namespace isomatch
