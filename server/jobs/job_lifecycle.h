#pragma once

#include <functional>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/jobs/caller.h"
#include "server/jobs/disconnect_guard.h"
#include "server/jobs/job_environment.h"
#include "server/jobs/job_retention.h"
#include "server/jobs/watchers.h"
#include "server/storage/job_record.h"

namespace isomatch {

/// The states of jobs, and the one way from each to the next:
///
///           QUEUED ------------------+--------------------+
///            ^ | slot and memory     | queue timeout      | Cancel
///    stopped | v                     v                    v
///           RUNNING ------------> FAILED             CANCELLED
///              |    error, run timeout                    ^
///              |                                          |
///              +-------------------- Cancel --------------+
///              v
///          SUCCEEDED
///
/// The job store has the truth; whoever changes it first is right. Knows no
/// queue and no worker. Thread-safe; no lock is held while others are called.
class JobLifecycle {
 public:
  /// Changes a record, or says why it must stay as it is.
  using Edit = std::function<absl::Status(JobRecord&)>;

  /// `cancel` is told of jobs that nobody watches any more, that want it so.
  JobLifecycle(const JobEnvironment& environment, JobRetention* retention,
               std::function<void(const std::string& id)> cancel);

  /// Those who follow jobs.
  Watchers& watchers() { return watchers_; }
  DisconnectGuard& guard() { return guard_; }

  /// Returns the job. NOT_FOUND (JOB_NOT_FOUND), UNAVAILABLE (STORAGE_FAILED).
  absl::StatusOr<JobRecord> Read(const std::string& id) const;

  /// The same if the caller may know of it, else NOT_FOUND.
  absl::StatusOr<JobRecord> Find(const Caller& caller,
                                 const std::string& id) const;

  /// Applies `edit` to the newest record, again if another change came first;
  /// tells the watchers.
  absl::StatusOr<JobRecord> Change(const std::string& id, const Edit& edit);

  /// The one function that changes a job's state. FAILED_PRECONDITION when the
  /// drawing above has no such arrow. on_state is told first, then the
  /// watchers: who hears of a job's end finds it counted.
  absl::StatusOr<JobRecord> Move(const std::string& id, JobState to,
                                 const Edit& edit = {});

  /// The job became RUNNING in a SharedJobStore.
  void OnClaimed(const JobRecord& record) { OnMoved(record); }

  /// Makes the job FAILED, or CANCELLED if `error` says so, unless its state or
  /// claim is another than the record's by now.
  absl::Status Fail(const JobRecord& record, const absl::Status& error);

 private:
  absl::StatusOr<JobRecord> Replace(const std::string& id, const Edit& edit);
  /// What follows from it, as far as there is memory.
  void OnMoved(const JobRecord& moved);

  const JobEnvironment& environment_;
  JobRetention& retention_;
  Watchers watchers_{[this](const std::string& id) { guard_.OnUnwatched(id); }};
  DisconnectGuard guard_;
};

}  // namespace isomatch
