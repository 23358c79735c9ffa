#include "server/postgres/migrations.h"

#include <string>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/postgres/schema_files.h"

namespace isomatch {
namespace {

/// Any number that no other program uses for a lock.
constexpr char kLock[] = "SELECT pg_advisory_xact_lock(22062020)";

/// The newest migration of the database, and the oldest program, by the
/// migrations that it has, that can work with it.
struct Version {
  int number = 0;
  int oldest_program = 0;
};

absl::Status ReadVersion(pqxx::transaction_base& database, Version* version) {
  const pqxx::result known =
      database.exec("SELECT to_regclass('isomatch.migrations') IS NOT NULL");
  *version = Version();
  if (!known[0][0].as<bool>()) return absl::OkStatus();
  const pqxx::result newest = database.exec(
      "SELECT coalesce(max(number), 0), coalesce(max(oldest_program), 0) "
      "FROM isomatch.migrations");
  *version = {newest[0][0].as<int>(), newest[0][1].as<int>()};
  return absl::OkStatus();
}

absl::Status CheckKnown(const Version& version) {
  if (version.oldest_program <= kNumSchemaFiles) return absl::OkStatus();
  return absl::FailedPreconditionError(absl::StrCat(
      "the database has version ", version.number,
      " of the tables, which needs programs that know at least version ",
      version.oldest_program, ", and this one knows ", kNumSchemaFiles,
      ": a newer isomatch-server has migrated it"));
}

std::string NameOf(pqxx::connection_base& database) {
  return absl::StrCat(database.dbname(), " at ", database.hostname());
}

/// Does the next migration that is missing; `is_done` when there is none.
/// `version` is what it found.
absl::Status MigrateOnce(pqxx::work& transaction, Version* version,
                         bool* is_done) {
  transaction.exec(kLock);
  ISOMATCH_RETURN_IF_ERROR(ReadVersion(transaction, version));
  ISOMATCH_RETURN_IF_ERROR(CheckKnown(*version));
  *is_done = version->number >= kNumSchemaFiles;
  if (*is_done) return absl::OkStatus();
  const SchemaFile& next = kSchemaFiles[version->number];
  transaction.exec(next.sql);
  transaction.exec_params(
      "INSERT INTO isomatch.migrations (number, name, oldest_program) "
      "VALUES ($1, $2, $3)",
      version->number + 1, next.name, next.oldest_program);
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<Migrated> Migrate(PostgresPool& pool) {
  Migrated migrated;
  bool is_done = false;
  for (bool is_first = true; !is_done; is_first = false) {
    Version version;
    ISOMATCH_RETURN_IF_ERROR(pool.Run([&](pqxx::work& transaction) {
      migrated.database = NameOf(transaction.conn());
      return MigrateOnce(transaction, &version, &is_done);
    }));
    if (is_first) migrated.from = version.number;
    migrated.to = version.number;
  }
  return migrated;
}

absl::Status CheckSchema(PostgresPool& pool) {
  Version version;
  const absl::Status read = pool.Run([&](pqxx::work& transaction) {
    return ReadVersion(transaction, &version);
  });
  if (absl::IsPermissionDenied(read)) {
    return absl::FailedPreconditionError(read.message());
  }
  ISOMATCH_RETURN_IF_ERROR(read);
  ISOMATCH_RETURN_IF_ERROR(CheckKnown(version));
  if (version.number >= kNumSchemaFiles) return absl::OkStatus();
  const std::string has =
      version.number == 0
          ? "no tables yet"
          : absl::StrCat("version ", version.number,
                         " of the tables, expected ", kNumSchemaFiles);
  return absl::FailedPreconditionError(
      absl::StrCat("the database has ", has,
                   ": run isomatch-server migrate --store URL first"));
}

}  // namespace isomatch
