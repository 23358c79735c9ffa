#pragma once

#include <memory>

#include "absl/status/statusor.h"
#include "server/postgres/postgres_pool.h"
#include "tests/support/postgres_server.h"

namespace isomatch {

/// Returns the PostgreSQL server of this test process, which is started when it
/// is asked for first.
absl::StatusOr<PostgresServer*> TheServer();

/// Returns a pool on that server's database, whose tables are new and empty.
absl::StatusOr<std::unique_ptr<PostgresPool>> NewDatabase(
    absl::Duration patience = absl::Seconds(5));

}  // namespace isomatch
