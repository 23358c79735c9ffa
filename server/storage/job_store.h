#pragma once

#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "server/storage/job_record.h"

namespace isomatch {

/// Which jobs List returns.
struct JobFilter {
  /// Not set for those of all tenants.
  std::optional<std::string> tenant = {};
  /// Empty for all.
  std::vector<JobState> states = {};
  /// Only jobs created before the one of this number; 0 for all.
  std::uint64_t before_number = 0;
  int limit = 100;
  /// Only jobs that have all of these.
  std::map<std::string, std::string> labels = {};
};

/// Which terminal jobs stay.
struct KeepLimits {
  /// Jobs that have a result, and as many that have none; of all tenants and of
  /// each.
  int max_jobs = 1000;
  int max_jobs_per_tenant = std::numeric_limits<int>::max();
  /// Bytes of all results together.
  std::int64_t max_result_bytes = std::int64_t{256} << 20;
  /// Others go for their age, by the two clocks of JobRecord.
  absl::Time ended_before = absl::InfinitePast();
  absl::Duration ended_before_steady = absl::InfiniteDuration();
  /// So many bytes of results have to go, whatever is within the limits.
  std::int64_t room_bytes = 0;
};

/// The record of all jobs. Thread-safe; changes are decided by sequence
/// numbers, so that no caller needs a lock across a read and a write. Every
/// function may also return UNAVAILABLE: the store does not answer just now.
class JobStore {
 public:
  virtual ~JobStore() = default;

  /// Adds a job and returns it with sequence and number. ALREADY_EXISTS when
  /// another job has its id, or another of its tenant its (non-empty)
  /// request_id. UNAVAILABLE or RESOURCE_EXHAUSTED: it could not be stored.
  virtual absl::StatusOr<JobRecord> Insert(JobRecord record) = 0;

  /// Replaces the job's record and returns it with its new sequence. ABORTED
  /// when record.sequence is not the stored one: read again and decide again.
  /// NOT_FOUND when the job is gone. Progress alone never waits for a disk:
  /// FAILED_PRECONDITION, and nothing has changed, while another change of the
  /// job is on its way there.
  virtual absl::StatusOr<JobRecord> Update(JobRecord record) = 0;

  /// NOT_FOUND when there is none.
  virtual absl::StatusOr<JobRecord> Get(const std::string& id) const = 0;
  virtual absl::StatusOr<JobRecord> FindByRequestId(
      const std::string& tenant, const std::string& request_id) const = 0;

  /// Whether a job of the tenant has the blob among its inputs, whatever its
  /// state.
  virtual absl::StatusOr<bool> HasInput(const std::string& tenant,
                                        const std::string& sha256) const = 0;

  /// Newest first.
  virtual absl::StatusOr<std::vector<JobRecord>> List(
      const JobFilter& filter) const = 0;

  /// Removes a terminal job and returns what it was. NOT_FOUND;
  /// FAILED_PRECONDITION when it is not terminal.
  virtual absl::StatusOr<JobRecord> Delete(const std::string& id) = 0;

  /// Tries again to keep what could not be kept before, and sees to it that a
  /// file that is lost takes little with it.
  virtual void Flush() = 0;

  /// Removes the terminal jobs that KeptJobs::Excess names, as many as the disk
  /// lets go, and returns them.
  virtual absl::StatusOr<std::vector<JobRecord>> Prune(
      const KeepLimits& limits) = 0;
};

}  // namespace isomatch
