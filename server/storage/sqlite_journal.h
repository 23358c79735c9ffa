#pragma once

#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "server/storage/job_journal.h"

namespace isomatch {

/// Records in an SQLite database (write-ahead log, synchronised at every
/// commit): one row a job, with columns for whoever looks with sqlite3.
///
/// Not thread-safe.
class SqliteJournal : public JobJournal {
 public:
  /// The version of the tables that this program writes. Older ones are brought
  /// up to it; newer ones are refused.
  static constexpr int kSchemaVersion = 1;

  /// Opens the database, or makes it. UNAVAILABLE: the file cannot be opened;
  /// DATA_LOSS: it is no database; FAILED_PRECONDITION: it was written by a
  /// newer version.
  static absl::StatusOr<std::unique_ptr<SqliteJournal>> Open(
      const std::string& path);

  ~SqliteJournal() override;

  struct Contents {
    /// By number.
    std::vector<JobRecord> records;
    /// Ids of rows that this program cannot read; they are left alone.
    std::vector<std::string> unreadable;
  };

  /// Returns all records. DATA_LOSS: the database is damaged.
  absl::StatusOr<Contents> Load();

  absl::Status Write(const std::vector<JobRecord>& records) override;
  absl::Status Remove(const std::vector<std::string>& ids) override;

 private:
  struct Impl;
  explicit SqliteJournal(std::unique_ptr<Impl> impl);

  const std::unique_ptr<Impl> impl_;
};

}  // namespace isomatch
