#include "server/jobs/job_lifecycle.h"

#include <utility>

#include "core/base/status_macros.h"
#include "server/jobs/errors.h"
#include "server/jobs/within_memory.h"

namespace isomatch {
namespace {

bool CanMove(JobState from, JobState to) {
  if (from == JobState::kQueued) {
    return to == JobState::kRunning || to == JobState::kFailed ||
           to == JobState::kCancelled;
  }
  return from == JobState::kRunning &&
         (IsTerminal(to) || to == JobState::kQueued);
}

/// It waits as if it had not been started, but in time it was.
void Rewind(JobRecord& record) {
  record.queue_timeout.reset();
  record.progress = JobProgress();
  record.start_time = absl::InfinitePast();
}

}  // namespace

JobLifecycle::JobLifecycle(const JobEnvironment& environment,
                           JobRetention* retention,
                           std::function<void(const std::string& id)> cancel)
    : environment_(environment),
      retention_(*retention),
      guard_(environment.limits.unwatched_grace, environment.timers, &watchers_,
             std::move(cancel)) {}

absl::StatusOr<JobRecord> JobLifecycle::Find(const Caller& caller,
                                             const std::string& id) const {
  ISOMATCH_ASSIGN_OR_RETURN(JobRecord record, Read(id));
  const bool may_know =
      caller.role == Role::kAdmin || caller.tenant == record.tenant;
  if (!may_know) return JobNotFound(id);
  return record;
}

absl::StatusOr<JobRecord> JobLifecycle::Read(const std::string& id) const {
  auto record = environment_.jobs->Get(id);
  if (record.ok()) return record;
  if (absl::IsNotFound(record.status())) return JobNotFound(id);
  return StorageSilent(record.status());
}

absl::StatusOr<JobRecord> JobLifecycle::Move(const std::string& id, JobState to,
                                             const Edit& edit) {
  const absl::Time latest = environment_.LatestTime();
  ISOMATCH_ASSIGN_OR_RETURN(JobRecord moved,
                            Replace(id, [&](JobRecord& record) {
                              if (!CanMove(record.state, to))
                                return JobIsTerminal(id, record.state);
                              record.hold = absl::ZeroDuration();
                              record.hold_reason.clear();
                              if (edit) ISOMATCH_RETURN_IF_ERROR(edit(record));
                              record.state = to;
                              if (IsTerminal(to)) {
                                record.end_time = environment_.now();
                                record.end_steady = environment_.uptime();
                                record.aged_from = latest;
                              }
                              if (to == JobState::kQueued) Rewind(record);
                              return absl::OkStatus();
                            }));
  OnMoved(moved);
  return moved;
}

void JobLifecycle::OnMoved(const JobRecord& moved) {
  const bool is_over = IsTerminal(moved.state);
  if (is_over) {
    guard_.Release(moved.id);
    retention_.UnpinInputs(moved);
  }
  // Else the log or a metric misses it.
  IfThereIsMemory([&] { environment_.on_state(moved); });
  WhenThereIsMemory([&] { watchers_.Notify(moved.id); });
  // Of a store that others share one process looks after the old ones.
  if (is_over && environment_.shared == nullptr) {
    IfThereIsMemory([&] { retention_.Prune(); });  // or next time
  }
}

absl::StatusOr<JobRecord> JobLifecycle::Change(const std::string& id,
                                               const Edit& edit) {
  auto changed = Replace(id, edit);
  if (changed.ok()) watchers_.Notify(id);
  return changed;
}

absl::StatusOr<JobRecord> JobLifecycle::Replace(const std::string& id,
                                                const Edit& edit) {
  while (true) {
    ISOMATCH_ASSIGN_OR_RETURN(JobRecord record, Read(id));
    ISOMATCH_RETURN_IF_ERROR(edit(record));
    auto changed = environment_.jobs->Update(std::move(record));
    if (!absl::IsAborted(changed.status())) return changed;
  }
}

absl::Status JobLifecycle::Fail(const JobRecord& record,
                                const absl::Status& error) {
  const bool is_cancelled = absl::IsCancelled(error);
  return Move(record.id,
              is_cancelled ? JobState::kCancelled : JobState::kFailed,
              [&](JobRecord& now) {
                if (now.state != record.state || now.claim != record.claim) {
                  return absl::FailedPreconditionError("too late");
                }
                if (!is_cancelled) now.error = JobErrorOf(error);
                return absl::OkStatus();
              })
      .status();
}

}  // namespace isomatch
