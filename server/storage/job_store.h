#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/storage/job_record.h"

namespace isomatch {

/// Which jobs List returns.
struct JobFilter {
  /// Empty for all.
  std::vector<JobState> states;
  /// Only jobs created before the one of this number; 0 for all.
  std::uint64_t before_number = 0;
  int limit = 100;
};

/// The record of all jobs. Thread-safe; changes are decided by sequence
/// numbers, so that no caller needs a lock across a read and a write.
class JobStore {
 public:
  virtual ~JobStore() = default;

  /// Adds a job and returns it with sequence and number. ALREADY_EXISTS when
  /// another job has its id or its (non-empty) request_id.
  virtual absl::StatusOr<JobRecord> Insert(JobRecord record) = 0;

  /// Replaces the job's record and returns it with its new sequence. ABORTED
  /// when record.sequence is not the stored one: read again and decide again.
  /// NOT_FOUND when the job is gone.
  virtual absl::StatusOr<JobRecord> Update(JobRecord record) = 0;

  virtual std::optional<JobRecord> Get(const std::string& id) const = 0;
  virtual std::optional<JobRecord> FindByRequestId(
      const std::string& request_id) const = 0;

  /// Newest first.
  virtual std::vector<JobRecord> List(const JobFilter& filter) const = 0;

  /// Removes a terminal job and returns what it was. NOT_FOUND;
  /// FAILED_PRECONDITION when it is not terminal.
  virtual absl::StatusOr<JobRecord> Delete(const std::string& id) = 0;

  /// Removes terminal jobs, the first that became so first, until at most
  /// `max_jobs` of them with `max_result_bytes` of results are left; never the
  /// last, however large its result. Returns the removed.
  virtual std::vector<JobRecord> Prune(int max_jobs,
                                       std::int64_t max_result_bytes) = 0;
};

}  // namespace isomatch
