#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "server/postgres/postgres_pool.h"
#include "server/storage/shared_job_store.h"

namespace isomatch {

/// The tables of server/postgres/schema/001_jobs.sql. Knows nothing by itself:
/// any number of these may use one database.
class PostgresJobStore : public SharedJobStore {
 public:
  struct Options {
    /// How long a job that is cancelled when nobody watches it waits for its
    /// first watcher.
    absl::Duration unwatched_grace = absl::Seconds(10);
    /// When the request and the results of a job that was removed go at the
    /// latest.
    absl::Duration blob_grace = absl::Minutes(10);
  };

  /// `pool` outlives this object. REQUIRES: CheckSchema(pool) is OK.
  PostgresJobStore(PostgresPool* pool, const Options& options)
      : pool_(*pool), options_(options) {}

  // Of JobStore.
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
  void Flush() override {}
  absl::StatusOr<std::vector<JobRecord>> Prune(
      const KeepLimits& limits) override;

  // Of SharedJobStore.
  absl::StatusOr<std::optional<JobRecord>> Claim(
      const ClaimRequest& request) override;
  absl::StatusOr<std::vector<std::string>> Renew(
      const std::vector<LeasedJob>& jobs, absl::Duration lease) override;
  absl::StatusOr<std::vector<JobRecord>> Expired(absl::Duration lease) override;
  absl::StatusOr<bool> TakeBack(const JobRecord& job, int faults) override;
  absl::StatusOr<std::vector<JobRecord>> Overdue() override;
  absl::Status KeepWatched(const std::vector<std::string>& ids,
                           absl::Duration grace) override;
  absl::StatusOr<std::vector<std::string>> Unwatched() override;
  absl::StatusOr<std::map<std::string, std::uint64_t>> LiveSequences(
      const std::vector<std::string>& ids) override;
  absl::StatusOr<std::vector<std::string>> InOrder() override;
  absl::StatusOr<QueueCounts> Count() override;
  absl::StatusOr<int> CountQueuedOf(const std::string& tenant) override;
  absl::Status Register(const WorkerEntry& entry) override;
  absl::Status Unregister(const std::string& worker) override;
  absl::StatusOr<std::vector<WorkerEntry>> Workers(absl::Duration age) override;
  absl::StatusOr<bool> HoldChore(const std::string& chore,
                                 const std::string& holder,
                                 absl::Duration term) override;
  absl::Status CheckVersion() override;
  /// Of transactions of other users it hears only if its own may
  /// pg_read_all_stats.
  absl::StatusOr<StoreFigures> Measure() override;
  std::int64_t errors() const override { return pool_.errors(); }

 private:
  PostgresPool& pool_;
  const Options options_;
};

}  // namespace isomatch
