#pragma once

#include <memory>
#include <string>
#include <utility>

#include <sys/types.h>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "tests/support/postgres_server.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {

/// A PgBouncer of the running test, in transaction mode, on a socket in a
/// temporary folder: between two transactions of a client its connection to the
/// database may be another one. A child of the thread that started it, and ends
/// with that thread. Not thread-safe.
class PgBouncer {
 public:
  /// Starts one before the database `server`, which outlives it. NOT_FOUND:
  /// which Debian package is missing; INTERNAL: what it wrote.
  static absl::StatusOr<std::unique_ptr<PgBouncer>> Start(
      const PostgresServer& server);
  ~PgBouncer();

  PgBouncer(const PgBouncer&) = delete;
  PgBouncer& operator=(const PgBouncer&) = delete;

  /// For libpq; stays the same after Restart.
  std::string url() const;

  /// Kills it by SIGKILL and starts it again. Returns once it listens.
  absl::Status Restart();

 private:
  explicit PgBouncer(std::string program) : program_(std::move(program)) {}

  void Kill();

  const std::string program_;
  TemporaryFolder folder_;
  pid_t id_ = 0;
};

}  // namespace isomatch
