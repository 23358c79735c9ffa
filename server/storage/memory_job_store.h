#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "core/base/mutex.h"
#include "server/storage/job_journal.h"
#include "server/storage/job_store.h"
#include "server/storage/kept_jobs.h"

namespace isomatch {

/// Records in memory: gone when the process ends, unless there is a journal.
/// Thread-safe; neither readers nor reports of progress wait for the journal.
class MemoryJobStore : public JobStore {
 public:
  using OnError = std::function<void(const absl::Status&)>;

  MemoryJobStore() = default;

  /// Begins with the `records` of an earlier process. The journal has new jobs
  /// and changes of state or attempt before anybody sees them; it does not have
  /// progress.
  ///
  /// When the journal fails, a new job is refused. Any other change holds in
  /// memory, is reported to `on_error` and is written with the next one; after
  /// a crash before that the job runs again.
  ///
  /// New jobs get numbers from `first_number` on. REQUIRES: it is above the
  /// numbers of jobs that were deleted, so that page tokens keep their place.
  MemoryJobStore(const std::vector<JobRecord>& records, JobJournal* journal,
                 OnError on_error, std::uint64_t first_number = 1);

  absl::StatusOr<JobRecord> Insert(JobRecord record) override;
  absl::StatusOr<JobRecord> Update(JobRecord record) override;
  absl::StatusOr<JobRecord> Get(const std::string& id) const override;
  absl::StatusOr<JobRecord> FindByRequestId(
      const std::string& tenant, const std::string& request_id) const override;
  absl::StatusOr<bool> HasInput(const std::string& tenant,
                                const std::string& sha256) const override;
  absl::StatusOr<std::vector<JobRecord>> List(
      const JobFilter& filter) const override;
  absl::StatusOr<JobRecord> Delete(const std::string& id) override;
  void Flush() override;
  absl::StatusOr<std::vector<JobRecord>> Prune(
      const KeepLimits& limits) override;

 private:
  using Records = std::unordered_map<std::string, JobRecord>;
  /// Tenant and request_id.
  using RequestKey = std::pair<std::string, std::string>;

  /// Puts a new record into all tables.
  void Add(const JobRecord& record) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  /// Removes the job from all tables.
  void Remove(const std::string& id) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  // The parts of Update.

  /// Returns the stored record; NOT_FOUND, ABORTED.
  absl::StatusOr<JobRecord*> FindSame(const JobRecord& record)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  /// Makes a change that the journal need not have.
  absl::StatusOr<JobRecord> Advance(JobRecord record, JobRecord& stored)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  /// Makes a change after the journal has it.
  absl::StatusOr<JobRecord> Keep(JobRecord record)
      ABSL_LOCKS_EXCLUDED(writer_mutex_, mutex_);

  /// Removes the jobs from the journal in this order, up to the first error;
  /// returns how many it removed.
  size_t RemoveFromJournal(const std::vector<std::string>& ids)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(writer_mutex_);

  /// Writes the records, and those that could not be written before.
  absl::Status WriteJournal(std::vector<JobRecord> records)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(writer_mutex_);

  JobJournal* const journal_ = nullptr;
  const OnError on_error_;

  /// Held by whoever changes what is kept, also while the journal writes. Taken
  /// before mutex_, which is only held for a moment.
  Mutex writer_mutex_;
  /// Jobs whose newest change is not in the journal.
  std::set<std::string> unwritten_ ABSL_GUARDED_BY(writer_mutex_);

  mutable Mutex mutex_;
  /// The job whose change the journal is writing, or empty.
  std::string being_kept_ ABSL_GUARDED_BY(mutex_);
  std::uint64_t last_sequence_ ABSL_GUARDED_BY(mutex_) = 0;
  std::uint64_t last_number_ ABSL_GUARDED_BY(mutex_) = 0;
  Records records_ ABSL_GUARDED_BY(mutex_);
  /// Number -> id.
  std::map<std::uint64_t, std::string> by_number_ ABSL_GUARDED_BY(mutex_);
  KeptJobs terminal_ ABSL_GUARDED_BY(mutex_);
  std::map<RequestKey, std::string> by_request_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace isomatch
