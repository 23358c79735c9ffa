#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "server/storage/job_journal.h"

namespace isomatch {

/// Records in an SQLite database (write-ahead log, synchronized at every
/// commit): one row a job, with columns for whoever looks with sqlite3 and a
/// checksum. Beside the database are PATH.mark, which tells when the end of the
/// log was lost, and PATH.reserve, which is given up so that Open and Remove
/// work on a full disk.
///
/// Not thread-safe.
class SqliteJournal : public JobJournal {
 public:
  /// The version of tables and records that this program writes. Older ones are
  /// brought up to it; newer ones are refused.
  static constexpr int kSchemaVersion = 4;

  /// Size of the file PATH.reserve.
  static constexpr std::int64_t kReserveBytes = 1 << 20;

  /// Opens the database, or makes it. UNAVAILABLE: the file cannot be opened;
  /// DATA_LOSS: it is no database; FAILED_PRECONDITION: it was written by a
  /// newer version.
  static absl::StatusOr<std::unique_ptr<SqliteJournal>> Open(
      const std::string& path);

  ~SqliteJournal() override;

  struct Contents {
    /// By number.
    std::vector<JobRecord> records;
    /// Ids of rows that this program cannot read, or that are not what was
    /// written; they are left alone.
    std::vector<std::string> unreadable;
    /// Jobs that came and changes that were made after what is here now; a job
    /// that was removed among them is here again. Told once.
    std::int64_t lost_jobs = 0;
    std::int64_t lost_changes = 0;
  };

  /// Returns all records. Call once, before Write and Remove. DATA_LOSS: the
  /// database is damaged.
  absl::StatusOr<Contents> Load();

  /// Also errors as Open. A disk that is full stays so for Write, so that there
  /// is room to remove.
  absl::Status Write(const std::vector<JobRecord>& records) override;
  absl::Status Remove(const std::vector<std::string>& ids) override;

  /// Bounds what is lost with the write-ahead log.
  void Settle() override;

 private:
  class Database;
  struct Impl;
  explicit SqliteJournal(std::unique_ptr<Impl> impl);

  const std::unique_ptr<Impl> impl_;
};

}  // namespace isomatch
