#include "tests/server/postgres/test_database.h"

#include <utility>

#include "core/base/status_macros.h"
#include "server/postgres/migrations.h"

namespace isomatch {

absl::StatusOr<PostgresServer*> TheServer() {
  static std::unique_ptr<PostgresServer> server;  // ends with the process
  if (server == nullptr) {
    ISOMATCH_ASSIGN_OR_RETURN(server, PostgresServer::Start());
  }
  return server.get();
}

absl::StatusOr<std::unique_ptr<PostgresPool>> NewDatabase(
    absl::Duration patience) {
  ISOMATCH_ASSIGN_OR_RETURN(PostgresServer* const server, TheServer());
  ISOMATCH_ASSIGN_OR_RETURN(
      std::unique_ptr<PostgresPool> pool,
      PostgresPool::Open({.url = server->url(), .patience = patience}));
  ISOMATCH_RETURN_IF_ERROR(pool->Run([](pqxx::work& transaction) {
    transaction.exec("DROP SCHEMA IF EXISTS isomatch CASCADE");
    return absl::OkStatus();
  }));
  ISOMATCH_RETURN_IF_ERROR(Migrate(*pool).status());
  return pool;
}

}  // namespace isomatch
