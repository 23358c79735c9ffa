#include "server/storage/sqlite_journal.h"

#include <algorithm>
#include <functional>
#include <optional>
#include <set>
#include <utility>

#include <SQLiteCpp/SQLiteCpp.h>
#include <sqlite3.h>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/str_cat.h"
#include "core/base/sha256.h"
#include "core/base/status_macros.h"
#include "server/storage/disk_reserve.h"
#include "server/storage/job_record_codec.h"
#include "server/storage/journal_mark.h"

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
    // Records of before have no checksum.
    R"(ALTER TABLE jobs ADD COLUMN checksum TEXT;
       CREATE TABLE journal (
         one INTEGER PRIMARY KEY CHECK (one = 1),
         commits INTEGER NOT NULL
       ) STRICT;
       INSERT INTO journal VALUES (1, 0);)",
    // Records that ever came, so that what was removed hides none that is lost.
    R"(ALTER TABLE journal ADD COLUMN jobs INTEGER NOT NULL DEFAULT 0;
       UPDATE journal SET jobs = (SELECT count(*) FROM jobs);)",
    // New records have JobResult::info, which programs before do not know.
    "",
};

constexpr char kWrite[] =
    "INSERT OR REPLACE INTO jobs (id, number, tenant, request_id, state, "
    "created, ended, record, checksum) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)";

absl::Status ErrorOf(const SQLite::Exception& error, const std::string& path) {
  const std::string message = absl::StrCat(path, ": ", error.what());
  // The index of the log, when it is made.
  if (error.getExtendedErrorCode() == SQLITE_IOERR_SHMSIZE) {
    return absl::ResourceExhaustedError(message);
  }
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

/// Returns the checksum of what a row holds.
std::string Checksum(const std::string& id, absl::string_view record) {
  constexpr size_t kDigits = 16;
  Sha256 sha256;
  sha256.Update(id);
  sha256.Update(record);
  return sha256.HexDigest().substr(0, kDigits);
}

absl::StatusOr<JobRecord> ReadRecord(SQLite::Statement& rows,
                                     const std::string& id) {
  const SQLite::Column column = rows.getColumn(1);
  const absl::string_view bytes(static_cast<const char*>(column.getBlob()),
                                static_cast<size_t>(column.getBytes()));
  const SQLite::Column checksum = rows.getColumn(2);
  if (!checksum.isNull() && checksum.getString() != Checksum(id, bytes)) {
    return absl::DataLossError("not the record that was written");
  }
  ISOMATCH_ASSIGN_OR_RETURN(JobRecord record, DecodeJobRecord(bytes));
  if (record.id != id) return absl::DataLossError("the record of another job");
  return record;
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
  statement.bind(9, Checksum(record.id, bytes));
}

}  // namespace

/// The tables as this program writes them. Throws.
class SqliteJournal::Database {
 public:
  explicit Database(const std::string& path)
      : database_(path, SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE,
                  /*aBusyTimeoutMs=*/5000) {}

  absl::Status Prepare(const std::string& path);

  /// Calls `change` with the statements and commits, with so many jobs more.
  void Commit(std::int64_t new_jobs,
              const std::function<void(SQLite::Statement& write,
                                       SQLite::Statement& remove)>& change);

  /// Writes what is in the log to the tables, so that the next commit uses the
  /// room of the log again.
  void EmptyLog() { database_.exec("PRAGMA wal_checkpoint(RESTART)"); }

  SQLite::Database& database() { return database_; }
  JournalMark::State state() {
    return {database_.execAndGet("SELECT commits FROM journal").getInt64(),
            database_.execAndGet("SELECT jobs FROM journal").getInt64()};
  }

 private:
  SQLite::Database database_;
  std::optional<SQLite::Statement> write_;
  std::optional<SQLite::Statement> remove_;
  std::optional<SQLite::Statement> count_;
};

absl::Status SqliteJournal::Database::Prepare(const std::string& path) {
  database_.exec("PRAGMA journal_mode = WAL");
  database_.exec("PRAGMA synchronous = FULL");
  const int version = database_.execAndGet("PRAGMA user_version").getInt();
  if (version > SqliteJournal::kSchemaVersion) {
    return absl::FailedPreconditionError(absl::StrCat(
        path, " has version ", version, " of the tables, expected at most ",
        SqliteJournal::kSchemaVersion, ": a newer isomatch-server wrote it"));
  }
  if (version < SqliteJournal::kSchemaVersion) {  // a full disk may refuse it
    SQLite::Transaction transaction(database_);
    for (int next = version; next < SqliteJournal::kSchemaVersion; ++next) {
      database_.exec(kMigrations[next]);
    }
    database_.exec(
        absl::StrCat("PRAGMA user_version = ", SqliteJournal::kSchemaVersion));
    transaction.commit();
  }
  write_.emplace(database_, kWrite);
  remove_.emplace(database_, "DELETE FROM jobs WHERE id = ?");
  count_.emplace(database_,
                 "UPDATE journal SET commits = commits + 1, jobs = jobs + ?");
  return absl::OkStatus();
}

void SqliteJournal::Database::Commit(
    std::int64_t new_jobs,
    const std::function<void(SQLite::Statement& write,
                             SQLite::Statement& remove)>& change) {
  // A statement that failed would keep the log from being emptied.
  const auto done = absl::MakeCleanup([this] {
    for (auto* statement : {&write_, &remove_, &count_}) {
      (*statement)->tryReset();
    }
  });
  SQLite::Transaction transaction(database_);
  change(*write_, *remove_);
  count_->bind(1, new_jobs);
  count_->exec();
  transaction.commit();
}

namespace {

/// Whether room may help.
bool MayPass(const absl::Status& status) {
  return absl::IsResourceExhausted(status) || absl::IsUnavailable(status);
}

}  // namespace

struct SqliteJournal::Impl {
  explicit Impl(const std::string& file)
      : path(file),
        mark(file + ".mark"),
        reserve(file + ".reserve", kReserveBytes) {}

  /// Opens the database and checks its tables.
  absl::Status OpenDatabase();

  /// What the mark says of before and what is in the database differ by.
  void CompareWithMark(Contents& contents);

  /// Of all jobs, into `contents`.
  void ReadRows(Contents& contents);

  /// New records, and those of jobs that changed.
  void WriteRows(std::int64_t new_jobs, const std::vector<JobRecord>& records);

  /// After a commit.
  void SetMark();

  /// After so many jobs came.
  void Committed(std::int64_t new_jobs);

  const std::string path;
  JournalMark mark;
  DiskReserve reserve;
  std::unique_ptr<Database> database;
  JournalMark::State state;
  std::set<std::string> ids;
};

absl::Status SqliteJournal::Impl::OpenDatabase() {
  return Guarded(path, [this] {
    database = std::make_unique<Database>(path);
    return database->Prepare(path);
  });
}

void SqliteJournal::Impl::ReadRows(Contents& contents) {
  SQLite::Statement rows(
      database->database(),
      "SELECT id, record, checksum FROM jobs ORDER BY number");
  while (rows.executeStep()) {
    const std::string id = rows.getColumn(0).getString();
    ids.insert(id);
    auto record = ReadRecord(rows, id);
    if (record.ok()) {
      contents.records.push_back(*std::move(record));
    } else {
      contents.unreadable.push_back(id);
    }
  }
  state = database->state();
}

void SqliteJournal::Impl::WriteRows(std::int64_t new_jobs,
                                    const std::vector<JobRecord>& records) {
  database->Commit(new_jobs, [&](SQLite::Statement& write, SQLite::Statement&) {
    for (const JobRecord& record : records) {
      write.tryReset();
      BindRecord(record, write);
      write.exec();
    }
  });
}

void SqliteJournal::Impl::SetMark() { mark.Write(state); }

void SqliteJournal::Impl::Committed(std::int64_t new_jobs) {
  ++state.commits;
  state.jobs += new_jobs;
  SetMark();
}

absl::StatusOr<std::unique_ptr<SqliteJournal>> SqliteJournal::Open(
    const std::string& path) {
  auto impl = std::make_unique<Impl>(path);
  absl::Status opened = impl->OpenDatabase();
  if (MayPass(opened) && impl->reserve.Release()) opened = impl->OpenDatabase();
  ISOMATCH_RETURN_IF_ERROR(opened);
  return std::unique_ptr<SqliteJournal>(new SqliteJournal(std::move(impl)));
}

SqliteJournal::SqliteJournal(std::unique_ptr<Impl> impl)
    : impl_(std::move(impl)) {}
SqliteJournal::~SqliteJournal() = default;

absl::StatusOr<SqliteJournal::Contents> SqliteJournal::Load() {
  Contents contents;
  ISOMATCH_RETURN_IF_ERROR(Guarded(impl_->path, [&] {
    impl_->ReadRows(contents);
    return absl::OkStatus();
  }));
  impl_->CompareWithMark(contents);
  return contents;
}

void SqliteJournal::Impl::CompareWithMark(Contents& contents) {
  const std::optional<JournalMark::State> seen = mark.Read();
  // One that lags behind says nothing of what came after it.
  if (seen && seen->commits >= state.commits) {
    contents.lost_changes = seen->commits - state.commits;
    contents.lost_jobs = std::max<std::int64_t>(0, seen->jobs - state.jobs);
  }
  SetMark();
}

absl::Status SqliteJournal::Write(const std::vector<JobRecord>& records) {
  impl_->reserve.Refill();
  const std::int64_t new_jobs = std::count_if(
      records.begin(), records.end(),
      [&](const JobRecord& job) { return impl_->ids.count(job.id) == 0; });
  ISOMATCH_RETURN_IF_ERROR(Guarded(impl_->path, [&] {
    impl_->WriteRows(new_jobs, records);
    return absl::OkStatus();
  }));
  for (const JobRecord& record : records) impl_->ids.insert(record.id);
  impl_->Committed(new_jobs);
  return absl::OkStatus();
}

absl::Status SqliteJournal::Remove(const std::vector<std::string>& ids) {
  const auto remove_all = [&] {
    impl_->database->Commit(0,
                            [&](SQLite::Statement&, SQLite::Statement& remove) {
                              for (const std::string& id : ids) {
                                remove.tryReset();
                                remove.bind(1, id);
                                remove.exec();
                              }
                            });
    return absl::OkStatus();
  };
  const auto empty_log_and_remove_all = [&] {
    impl_->database->EmptyLog();
    return remove_all();
  };
  absl::Status removed = Guarded(impl_->path, remove_all);
  if (MayPass(removed)) {
    removed = Guarded(impl_->path, empty_log_and_remove_all);
  }
  if (MayPass(removed) && impl_->reserve.Release()) {
    removed = Guarded(impl_->path, empty_log_and_remove_all);
  }
  ISOMATCH_RETURN_IF_ERROR(removed);
  for (const std::string& id : ids) impl_->ids.erase(id);
  impl_->Committed(0);
  return absl::OkStatus();
}

void SqliteJournal::Settle() {
  // A connection of its own, beside which others write.
  (void)Guarded(impl_->path, [&] {
    SQLite::Database database(impl_->path, SQLite::OPEN_READWRITE);
    database.exec("PRAGMA wal_checkpoint(PASSIVE)");
    return absl::OkStatus();
  });
}

}  // namespace isomatch
