#pragma once

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
/// Errors as OpenAnyStores.
absl::Status MigrateStore(const ServerConfig& config);

}  // namespace isomatch
