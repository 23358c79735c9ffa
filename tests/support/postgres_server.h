#pragma once

#include <memory>
#include <string>
#include <utility>

#include <sys/types.h>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {

/// Returns the path of one of PostgreSQL's programs, in PATH or where Debian
/// has them. NOT_FOUND: which package is missing.
absl::StatusOr<std::string> FindPostgresProgram(const std::string& name);

/// A PostgreSQL server of the running test, with an empty database `isomatch`,
/// on a socket in a temporary folder. It is a child of the thread that started
/// it, and ends with that thread, however that ends. Not thread-safe.
class PostgresServer {
 public:
  struct Options {
    /// Whether it waits for the disk. Without that, what was committed survives
    /// Kill, but not the loss of power.
    bool fsync = false;
    /// Also listens at this address, on port 5432; empty for none.
    std::string address = "";
    /// From where it can be reached, as ADDRESS/BITS.
    std::string network = "";
  };

  /// Starts one, half a second the first time in a process, then a tenth.
  /// NOT_FOUND: which Debian package is missing; INTERNAL: what it wrote.
  static absl::StatusOr<std::unique_ptr<PostgresServer>> Start();
  static absl::StatusOr<std::unique_ptr<PostgresServer>> Start(Options options);

  /// Stops it at once.
  ~PostgresServer();

  PostgresServer(const PostgresServer&) = delete;
  PostgresServer& operator=(const PostgresServer&) = delete;

  /// For libpq; stays the same after Restart.
  std::string url() const;
  /// The same by its address.
  std::string tcp_url() const;

  /// The folder of its socket, and the socket.
  std::string folder() const { return folder_.Path(""); }
  std::string socket() const { return folder_.Path(".s.PGSQL.5432"); }

  /// 0 while it does not run.
  pid_t id() const { return id_; }

  /// Ends it by SIGKILL, with the processes of its connections, and waits.
  void Kill();

  /// Starts it again with the data that it has, after Kill if it still runs.
  /// Returns once it answers. Errors as Start.
  absl::Status Restart();

 private:
  PostgresServer(std::string program, Options options)
      : program_(std::move(program)), options_(std::move(options)) {}

  absl::Status WaitUntilItAnswers();

  const std::string program_;
  const Options options_;
  TemporaryFolder folder_;
  pid_t id_ = 0;
};

}  // namespace isomatch
