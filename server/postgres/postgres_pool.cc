#include "server/postgres/postgres_pool.h"

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <exception>
#include <utility>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

/// PostgreSQL's messages end with a line feed, and go on with hints.
std::string FirstLine(const char* message) {
  const std::string text = message;
  return text.substr(0, text.find('\n'));
}

/// What the codes of SQLSTATE that are about the server, not about the
/// statement, mean: class 53 insufficient resources, 57 operator intervention,
/// 58 system error, 40 rollback, 55 not in the state for it, XX damage.
absl::Status ErrorOf(const pqxx::sql_error& error) {
  const std::string state = error.sqlstate();
  const std::string message =
      absl::StrCat("database: ", FirstLine(error.what()));
  // libpqxx 6 does not tell the state of this one.
  if (dynamic_cast<const pqxx::insufficient_privilege*>(&error) != nullptr) {
    return absl::PermissionDeniedError(absl::StrCat(
        message,
        "; the role of --store needs rights on the schema isomatch, see "
        "server/README.md"));
  }
  if (state == "23505") return absl::AlreadyExistsError(message);
  if (state == "23503") return absl::FailedPreconditionError(message);
  if (state == "53100") return absl::ResourceExhaustedError(message);
  if (state == "XX001" || state == "XX002") return absl::DataLossError(message);
  if (absl::StartsWith(state, "40")) return absl::AbortedError(message);
  for (const char* passing : {"08", "53", "55", "57", "58", "25"}) {
    if (absl::StartsWith(state, passing)) {
      return absl::UnavailableError(message);
    }
  }
  return absl::InternalError(
      state.empty() ? message : absl::StrCat(message, " (", state, ")"));
}

/// Returns `text` as a URL's query, or a connection string, may have it.
std::string Escaped(const std::string& text, bool is_url) {
  std::string escaped = is_url ? "" : "'";
  for (const char c : text) {
    if (is_url && !absl::ascii_isalnum(c)) {
      absl::StrAppend(
          &escaped, "%",
          absl::Hex(static_cast<unsigned char>(c), absl::kZeroPad2));
      continue;
    }
    if (!is_url && (c == '\'' || c == '\\')) escaped += '\\';
    escaped += c;
  }
  return is_url ? escaped : escaped + "'";
}

/// Returns the whole text that libpq connects by.
std::string ConnectionText(const PostgresPool::Options& options,
                           const std::string& password) {
  const std::int64_t milliseconds = absl::ToInt64Milliseconds(options.patience);
  const bool is_url = absl::StrContains(options.url, "://");
  std::vector<std::string> settings = {
      // Two seconds are the least that it has.
      absl::StrCat("connect_timeout=",
                   std::max<std::int64_t>((milliseconds + 999) / 1000, 2)),
      absl::StrCat("tcp_user_timeout=", milliseconds),
      "keepalives_idle=5",
      "keepalives_interval=2",
      "keepalives_count=3",
      "application_name=isomatch"};
  if (!password.empty()) {
    settings.push_back(absl::StrCat("password=", Escaped(password, is_url)));
  }
  if (!is_url)
    return absl::StrCat(options.url, " ", absl::StrJoin(settings, " "));
  return absl::StrCat(options.url,
                      absl::StrContains(options.url, "?") ? "&" : "?",
                      absl::StrJoin(settings, "&"));
}

}  // namespace

/// A connection of the pool for the length of a scope.
class PostgresPool::Lease {
 public:
  Lease(PostgresPool* pool, Connection connection)
      : pool_(pool), connection_(std::move(connection)) {}
  ~Lease() { pool_->GiveBack(std::move(connection_)); }
  Lease(const Lease&) = delete;
  Lease& operator=(const Lease&) = delete;

  Connection& connection() { return connection_; }

 private:
  PostgresPool* const pool_;
  Connection connection_;
};

absl::StatusOr<std::unique_ptr<PostgresPool>> PostgresPool::Open(
    Options options) {
  std::unique_ptr<PostgresPool> pool(new PostgresPool(std::move(options)));
  ISOMATCH_RETURN_IF_ERROR(pool->Run([](pqxx::work& transaction) {
    transaction.exec("SELECT 1");
    return absl::OkStatus();
  }));
  return pool;
}

absl::StatusOr<PostgresPool::Connection> PostgresPool::Take() {
  const auto deadline = std::chrono::steady_clock::now() +
                        absl::ToChronoMilliseconds(options_.patience);
  MutexLock lock(mutex_);
  while (in_use_ >= options_.connections) {
    if (!returned_.WaitUntil(mutex_, deadline) &&
        in_use_ >= options_.connections) {
      ++errors_;
      return absl::UnavailableError(absl::StrCat(
          "database: all ", options_.connections, " connections are in use"));
    }
  }
  ++in_use_;
  const absl::Status up = WaitForProbe();
  if (!up.ok()) {
    --in_use_;
    return up;
  }
  if (idle_.empty()) return nullptr;
  Connection connection = std::move(idle_.back());
  idle_.pop_back();
  return connection;
}

absl::StatusOr<PostgresPool::Connection> PostgresPool::Connect() {
  bool has_connected = false;
  const auto ended = absl::MakeCleanup([&] { EndProbe(has_connected); });
  std::string password;
  if (options_.password != nullptr) {
    absl::StatusOr<std::string> found = options_.password();
    if (!found.ok()) {
      ++errors_;
      return absl::UnavailableError(
          absl::StrCat("database: ", found.status().message()));
    }
    password = *std::move(found);
  }
  auto connection =
      std::make_unique<pqxx::connection>(ConnectionText(options_, password));
  has_connected = true;
  return connection;
}

absl::Status PostgresPool::WaitForProbe() {
  const auto deadline =
      std::chrono::steady_clock::now() + std::chrono::seconds(1);
  while (is_down_ && is_probing_ && idle_.empty()) {
    if (!returned_.WaitUntil(mutex_, deadline)) break;
  }
  if (!is_down_ || !idle_.empty()) return absl::OkStatus();
  if (is_probing_) return absl::UnavailableError("database: does not answer");
  is_probing_ = true;
  return absl::OkStatus();
}

void PostgresPool::EndProbe(bool has_connected) {
  MutexLock lock(mutex_);
  is_down_ = !has_connected;
  is_probing_ = false;
  returned_.NotifyAll();
}

void PostgresPool::GiveBack(Connection connection) {
  MutexLock lock(mutex_);
  --in_use_;
  if (connection != nullptr) idle_.push_back(std::move(connection));
  returned_.NotifyAll();
}

void PostgresPool::ForgetIdle() {
  std::vector<Connection> closed;  // without the lock
  MutexLock lock(mutex_);
  closed.swap(idle_);
}

absl::Status PostgresPool::Run(const Work& work) {
  const std::int64_t timeout = absl::ToInt64Milliseconds(options_.patience);
  const std::string limits = absl::StrCat(
      "SET LOCAL statement_timeout = ", timeout,
      "; SET LOCAL lock_timeout = ", timeout,
      "; SET LOCAL idle_in_transaction_session_timeout = ", timeout);
  return Try([&](pqxx::connection& connection, bool* is_done) -> absl::Status {
    pqxx::work transaction(connection);
    transaction.exec(limits);
    ISOMATCH_RETURN_IF_ERROR(work(transaction));
    *is_done = true;
    transaction.commit();
    return absl::OkStatus();
  });
}

absl::Status PostgresPool::RunAlone(const Statement& statement, Repeat repeat) {
  return Try([&](pqxx::connection& connection, bool* is_done) {
    *is_done = repeat == Repeat::kNever;
    pqxx::nontransaction database(connection);
    return statement(database);
  });
}

absl::Status PostgresPool::Try(const Attempt& attempt) {
  bool may_repeat = false;
  absl::Status status = TryOnce(attempt, &may_repeat);
  if (!may_repeat) return status;
  return TryOnce(attempt, &may_repeat);
}

absl::Status PostgresPool::TryOnce(const Attempt& attempt, bool* may_repeat) {
  ISOMATCH_ASSIGN_OR_RETURN(Connection taken, Take());
  const bool is_old = taken != nullptr;
  Lease lease(this, std::move(taken));
  bool is_done = false;
  const auto unavailable = [&](const std::exception& error) {
    ++errors_;
    lease.connection().reset();
    if (is_old) ForgetIdle();  // they are as old
    *may_repeat = is_old && !is_done;
    return absl::UnavailableError(
        absl::StrCat("database: ", FirstLine(error.what())));
  };
  try {
    if (!is_old) {
      ISOMATCH_ASSIGN_OR_RETURN(lease.connection(), Connect());
    }
    return attempt(*lease.connection(), &is_done);
  } catch (const pqxx::broken_connection& error) {
    return unavailable(error);
  } catch (const pqxx::in_doubt_error& error) {
    return unavailable(error);
  } catch (const pqxx::statement_completion_unknown& error) {
    return unavailable(error);
  } catch (const pqxx::transaction_rollback& error) {
    ++errors_;
    return absl::AbortedError(
        absl::StrCat("database: ", FirstLine(error.what())));
  } catch (const pqxx::sql_error& error) {
    absl::Status status = ErrorOf(error);
    if (absl::IsUnavailable(status)) return unavailable(error);
    ++errors_;
    return status;
  } catch (const pqxx::failure& error) {
    return unavailable(error);
  }
}

}  // namespace isomatch
