#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "core/base/mutex.h"
#include "server/storage/job_store.h"

namespace isomatch {

/// Records in memory: gone when the process ends. Thread-safe.
class MemoryJobStore : public JobStore {
 public:
  absl::StatusOr<JobRecord> Insert(JobRecord record) override;
  absl::StatusOr<JobRecord> Update(JobRecord record) override;
  std::optional<JobRecord> Get(const std::string& id) const override;
  std::optional<JobRecord> FindByRequestId(
      const std::string& request_id) const override;
  std::vector<JobRecord> List(const JobFilter& filter) const override;
  absl::StatusOr<JobRecord> Delete(const std::string& id) override;
  std::vector<JobRecord> Prune(int max_jobs,
                               std::int64_t max_result_bytes) override;

 private:
  using Records = std::unordered_map<std::string, JobRecord>;

  /// Removes the job from all tables and returns it.
  JobRecord Remove(Records::iterator position)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  mutable Mutex mutex_;
  std::uint64_t last_sequence_ ABSL_GUARDED_BY(mutex_) = 0;
  std::uint64_t last_number_ ABSL_GUARDED_BY(mutex_) = 0;
  Records records_ ABSL_GUARDED_BY(mutex_);
  /// Number -> id.
  std::map<std::uint64_t, std::string> by_number_ ABSL_GUARDED_BY(mutex_);
  /// Sequence of the terminal change -> id.
  std::map<std::uint64_t, std::string> terminal_ ABSL_GUARDED_BY(mutex_);
  std::unordered_map<std::string, std::string> by_request_id_
      ABSL_GUARDED_BY(mutex_);
  /// Of all terminal jobs.
  std::int64_t result_bytes_ ABSL_GUARDED_BY(mutex_) = 0;
};

}  // namespace isomatch
