#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/postgres/postgres_pool.h"

namespace isomatch {

/// What Migrate has found and done. Versions are numbers of files, 0 without
/// tables.
struct Migrated {
  /// "DATABASE at HOST", as the connection has it.
  std::string database;
  int from = 0;
  int to = 0;
};

/// Brings the tables of the database, schema `isomatch`, to the version of this
/// program, one file of server/postgres/schema after the other, each in a
/// transaction of its own and under a lock, so that several may call it at the
/// same time. Nothing when they have it. FAILED_PRECONDITION: a newer program
/// has migrated them to what this one does not know. Errors as
/// PostgresPool::Run.
absl::StatusOr<Migrated> Migrate(PostgresPool& pool);

/// Returns OK when the tables are those of this program, or newer ones that it
/// can work with. FAILED_PRECONDITION, which says what to do, when they are
/// not, or when the role may not read them.
absl::Status CheckSchema(PostgresPool& pool);

}  // namespace isomatch
