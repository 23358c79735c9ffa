#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <pqxx/pqxx>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "core/base/mutex.h"

namespace isomatch {

/// Connections to one PostgreSQL database, opened when they are needed and kept
/// for the next transaction. Nothing outlives a transaction on the server (no
/// session settings, no prepared statements), so that PgBouncer may stand
/// between. Thread-safe.
class PostgresPool {
 public:
  struct Options {
    /// postgresql://USER:PASSWORD@HOST:PORT/DATABASE or libpq's "key=value"
    /// form. What it leaves out libpq takes from its environment (PGPASSWORD,
    /// PGPASSFILE, ...).
    std::string url;
    /// Asked for the password at each new connection, so that one that is
    /// changed meanwhile is the next one's; null when the URL has it. Its error
    /// is that of the connection, UNAVAILABLE.
    std::function<absl::StatusOr<std::string>()> password = nullptr;
    /// Transactions at the same time; others wait for their turn.
    int connections = 8;
    /// How long a call may wait for a connection, a new connection for its
    /// server, and a statement for its end.
    absl::Duration patience = absl::Seconds(5);
  };

  /// What is done in one transaction, which is rolled back when it returns an
  /// error or throws what libpqxx throws. May be run again from its beginning.
  using Work = std::function<absl::Status(pqxx::work& transaction)>;

  /// One statement, which is a transaction by itself and needs one way to the
  /// server and back, where Work needs four.
  using Statement = std::function<absl::Status(pqxx::nontransaction& database)>;

  /// Whether a statement may be done twice, when it is not known whether it was
  /// done before the connection broke.
  enum class Repeat { kNever, kOnce };

  /// Returns a pool that has reached its database once. INVALID_ARGUMENT: the
  /// URL; UNAVAILABLE: the database does not answer, or refuses the user. No
  /// message has the password.
  static absl::StatusOr<std::unique_ptr<PostgresPool>> Open(Options options);

  /// Runs `work` in a transaction and commits it; again, once, on a new
  /// connection when the first turns out to be broken before the commit.
  /// Errors of `work`, and UNAVAILABLE: no connection, or one that broke (after
  /// a commit that was under way it may have happened); RESOURCE_EXHAUSTED: the
  /// database's disk is full; ABORTED: a deadlock, may be tried again;
  /// ALREADY_EXISTS and FAILED_PRECONDITION: a unique or a foreign key;
  /// PERMISSION_DENIED: rights that the role does not have; DATA_LOSS: damaged
  /// pages; INTERNAL: whatever else.
  absl::Status Run(const Work& work);

  /// Runs `statement`. Errors as Run.
  absl::Status RunAlone(const Statement& statement, Repeat repeat);

  /// Returns the rows of one statement with the parameters $1, $2, ...
  template <typename... Parameters>
  absl::StatusOr<pqxx::result> Ask(Repeat repeat, const std::string& sql,
                                   const Parameters&... parameters) {
    pqxx::result rows;
    const absl::Status status = RunAlone(
        [&](pqxx::nontransaction& database) {
          rows = database.exec_params(sql, parameters...);
          return absl::OkStatus();
        },
        repeat);
    if (!status.ok()) return status;
    return rows;
  }

  const Options& options() const { return options_; }

  /// Returns how often the database has not answered or refused something, also
  /// where a second attempt went well.
  std::int64_t errors() const { return errors_; }

 private:
  class Lease;

  explicit PostgresPool(Options options) : options_(std::move(options)) {}

  using Connection = std::unique_ptr<pqxx::connection>;
  /// A connection that nobody uses, or null for a place that has none yet: then
  /// Connect has to follow.
  absl::StatusOr<Connection> Take();
  void GiveBack(Connection connection);
  void ForgetIdle();
  /// What is tried with a connection; sets `is_done` when from now on it may
  /// have been done.
  using Attempt =
      std::function<absl::Status(pqxx::connection& connection, bool* is_done)>;
  absl::Status Try(const Attempt& attempt);
  /// `may_repeat`: it was not done, and the connection was not new.
  absl::Status TryOnce(const Attempt& attempt, bool* may_repeat);

  /// While no connection can be made: one caller at a time tries, the others
  /// wait for what it finds, for a second at most.
  absl::Status WaitForProbe() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void EndProbe(bool has_connected);
  /// UNAVAILABLE: no password; throws what libpqxx throws.
  absl::StatusOr<Connection> Connect();

  const Options options_;
  std::atomic<std::int64_t> errors_ = 0;
  Mutex mutex_;
  CondVar returned_;
  std::vector<Connection> idle_ ABSL_GUARDED_BY(mutex_);
  int in_use_ ABSL_GUARDED_BY(mutex_) = 0;
  /// The last attempt to connect failed; somebody tries again.
  bool is_down_ ABSL_GUARDED_BY(mutex_) = false;
  bool is_probing_ ABSL_GUARDED_BY(mutex_) = false;
};

}  // namespace isomatch
