#include "server/storage/sqlite_journal.h"

#include <functional>
#include <optional>
#include <utility>

#include <SQLiteCpp/SQLiteCpp.h>
#include <sqlite3.h>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/storage/job_record_codec.h"

namespace isomatch {
namespace {

// Each brings the tables from its index to the next version.
constexpr const char* kMigrations[SqliteJournal::kSchemaVersion] = {
    R"(CREATE TABLE jobs (
         id TEXT PRIMARY KEY,
         number INTEGER NOT NULL,
         tenant TEXT NOT NULL,
         request_id TEXT NOT NULL,
         state TEXT NOT NULL,
         created TEXT NOT NULL,
         ended TEXT,
         record BLOB NOT NULL
       ) STRICT, WITHOUT ROWID;
       CREATE UNIQUE INDEX jobs_by_request ON jobs (tenant, request_id)
         WHERE request_id <> '';)",
};

constexpr char kWrite[] =
    "INSERT OR REPLACE INTO jobs (id, number, tenant, request_id, state, "
    "created, ended, record) VALUES (?, ?, ?, ?, ?, ?, ?, ?)";

absl::Status ErrorOf(const SQLite::Exception& error, const std::string& path) {
  const std::string message = absl::StrCat(path, ": ", error.what());
  switch (error.getErrorCode()) {
    case SQLITE_FULL:
      return absl::ResourceExhaustedError(message);
    case SQLITE_NOTADB:
    case SQLITE_CORRUPT:
      return absl::DataLossError(message);
    default:
      return absl::UnavailableError(message);
  }
}

/// SQLiteCpp throws; we do not.
absl::Status Guarded(const std::string& path,
                     const std::function<absl::Status()>& work) {
  try {
    return work();
  } catch (const SQLite::Exception& error) {
    return ErrorOf(error, path);
  }
}

std::string TimeText(absl::Time time) {
  return absl::FormatTime("%Y-%m-%dT%H:%M:%E3SZ", time, absl::UTCTimeZone());
}

void BindRecord(const JobRecord& record, SQLite::Statement& statement) {
  const std::string bytes = EncodeJobRecord(record);
  statement.bind(1, record.id);
  statement.bind(2, static_cast<std::int64_t>(record.number));
  statement.bind(3, record.tenant);
  statement.bind(4, record.request_id);
  statement.bind(5, JobStateName(record.state));
  statement.bind(6, TimeText(record.create_time));
  if (IsTerminal(record.state)) {
    statement.bind(7, TimeText(record.end_time));
  } else {
    statement.bind(7);
  }
  statement.bind(8, bytes.data(), static_cast<int>(bytes.size()));
}

}  // namespace

struct SqliteJournal::Impl {
  explicit Impl(const std::string& file)
      : path(file),
        database(file, SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE,
                 /*aBusyTimeoutMs=*/5000) {}

  absl::Status Prepare();

  const std::string path;
  SQLite::Database database;
  std::optional<SQLite::Statement> write;
  std::optional<SQLite::Statement> remove;
};

absl::Status SqliteJournal::Impl::Prepare() {
  database.exec("PRAGMA journal_mode = WAL");
  database.exec("PRAGMA synchronous = FULL");
  const int version = database.execAndGet("PRAGMA user_version").getInt();
  if (version > kSchemaVersion) {
    return absl::FailedPreconditionError(absl::StrCat(
        path, " has version ", version, " of the tables, expected at most ",
        kSchemaVersion, ": a newer isomatch-server wrote it"));
  }
  SQLite::Transaction transaction(database);
  for (int next = version; next < kSchemaVersion; ++next) {
    database.exec(kMigrations[next]);
  }
  database.exec(absl::StrCat("PRAGMA user_version = ", kSchemaVersion));
  transaction.commit();
  write.emplace(database, kWrite);
  remove.emplace(database, "DELETE FROM jobs WHERE id = ?");
  return absl::OkStatus();
}

absl::StatusOr<std::unique_ptr<SqliteJournal>> SqliteJournal::Open(
    const std::string& path) {
  std::unique_ptr<Impl> impl;
  ISOMATCH_RETURN_IF_ERROR(Guarded(path, [&] {
    impl = std::make_unique<Impl>(path);
    return impl->Prepare();
  }));
  return std::unique_ptr<SqliteJournal>(new SqliteJournal(std::move(impl)));
}

SqliteJournal::SqliteJournal(std::unique_ptr<Impl> impl)
    : impl_(std::move(impl)) {}
SqliteJournal::~SqliteJournal() = default;

absl::StatusOr<SqliteJournal::Contents> SqliteJournal::Load() {
  Contents contents;
  ISOMATCH_RETURN_IF_ERROR(Guarded(impl_->path, [&] {
    SQLite::Statement rows(impl_->database,
                           "SELECT id, record FROM jobs ORDER BY number");
    while (rows.executeStep()) {
      const SQLite::Column column = rows.getColumn(1);
      auto record = DecodeJobRecord({static_cast<const char*>(column.getBlob()),
                                     static_cast<size_t>(column.getBytes())});
      if (record.ok()) {
        contents.records.push_back(*std::move(record));
      } else {
        contents.unreadable.push_back(rows.getColumn(0).getString());
      }
    }
    return absl::OkStatus();
  }));
  return contents;
}

absl::Status SqliteJournal::Write(const std::vector<JobRecord>& records) {
  return Guarded(impl_->path, [&] {
    SQLite::Transaction transaction(impl_->database);
    for (const JobRecord& record : records) {
      impl_->write->tryReset();
      BindRecord(record, *impl_->write);
      impl_->write->exec();
    }
    transaction.commit();
    return absl::OkStatus();
  });
}

absl::Status SqliteJournal::Remove(const std::vector<std::string>& ids) {
  return Guarded(impl_->path, [&] {
    SQLite::Transaction transaction(impl_->database);
    for (const std::string& id : ids) {
      impl_->remove->tryReset();
      impl_->remove->bind(1, id);
      impl_->remove->exec();
    }
    transaction.commit();
    return absl::OkStatus();
  });
}

}  // namespace isomatch
