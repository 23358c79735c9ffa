#pragma once

#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/base/mutex.h"
#include "server/engine/job_spec.h"
#include "server/jobs/caller.h"
#include "server/jobs/job_environment.h"
#include "server/jobs/job_lifecycle.h"
#include "server/jobs/job_retention.h"
#include "server/jobs/job_scheduler.h"
#include "server/storage/job_record.h"

namespace isomatch {

/// A job's way in: from a request to a QUEUED job in the stores and in the
/// queue. Thread-safe.
class JobIntake {
 public:
  /// A seat in the queue for one more job, given back when it goes.
  class Seat;
  using SeatPtr = std::shared_ptr<Seat>;

  JobIntake(const JobEnvironment& environment, JobLifecycle* lifecycle,
            JobRetention* retention, JobScheduler* scheduler)
      : environment_(environment),
        lifecycle_(*lifecycle),
        retention_(*retention),
        scheduler_(*scheduler) {}

  /// See JobManager.
  absl::StatusOr<std::optional<JobSnapshot>> FindRequest(
      const Caller& caller, const std::string& request_id,
      const std::string& request_sha256) const;
  absl::StatusOr<SeatPtr> TakeSeat(const Caller& caller,
                                   const std::string& request_id);
  absl::StatusOr<JobSnapshot> Create(const Caller& caller, JobSpec spec,
                                     SeatPtr seat);

 private:
  /// `shared`: what the store that others share has said before.
  absl::Status TakeSeatLocked(Seat& seat, const QueueRoom* shared)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  absl::Status CheckRoomLocked(const std::string& tenant,
                               const QueueRoom& room) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void GiveSeatBack(const std::string& tenant);
  JobRecord NewRecord(const Caller& caller, const JobSpec& spec) const;
  absl::StatusOr<JobSnapshot> Accept(const Caller& caller,
                                     const JobRecord& record,
                                     std::unique_ptr<JobSpec> spec);
  absl::StatusOr<JobRecord> Store(const JobRecord& record,
                                  std::vector<JobInput> inputs);
  absl::Status StoreInputs(const JobRecord& record,
                           std::vector<JobInput> inputs);
  absl::Status StoreInput(const std::string& tenant, JobInput& input);

  const JobEnvironment& environment_;
  JobLifecycle& lifecycle_;
  JobRetention& retention_;
  JobScheduler& scheduler_;
  mutable Mutex mutex_;
  /// The tenant of each seat that is taken.
  std::multiset<std::string> seated_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace isomatch
