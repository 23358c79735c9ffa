#include "server/jobs/job_manager.h"

#include <algorithm>
#include <limits>
#include <memory>
#include <utility>

#include "core/base/status_macros.h"
#include "server/jobs/errors.h"

namespace isomatch {
namespace {

/// What a worker gets that is marked as stuck at the same moment.
constexpr absl::Duration kLastAnswers = absl::Seconds(1);

}  // namespace

JobManager::JobManager(JobEnvironment environment)
    : environment_(std::move(environment)),
      disk_(environment_.disk),
      retention_(environment_, &disk_),
      lifecycle_(environment_, &retention_,
                 [this](const std::string& id) {
                   (void)scheduler_.Stop(id, JobState::kCancelled);
                 }),
      scheduler_(environment_, &lifecycle_, &disk_,
                 [this](const std::shared_ptr<LiveJob>& live) {
                   execution_.Run(live);
                 }),
      watchdog_(environment_, &lifecycle_, &scheduler_),
      execution_(environment_, &lifecycle_, &retention_, &scheduler_,
                 &watchdog_),
      intake_(environment_, &lifecycle_, &retention_, &scheduler_),
      member_(environment_, &lifecycle_, &retention_, &scheduler_) {}

// Beginning.

void JobManager::Begin() {
  if (environment_.shared != nullptr) {
    member_.Begin();
    if (environment_.watch != nullptr) watchdog_.Begin();
    return;
  }
  JobFilter all;
  all.limit = std::numeric_limits<int>::max();
  // What is in this process is there, or the process is not.
  std::vector<JobRecord> records = *environment_.jobs->List(all);
  std::reverse(records.begin(), records.end());  // the oldest first
  scheduler_.Begin();
  // All pins before anything is stored or forgotten.
  for (const JobRecord& record : records) retention_.Pin(record);
  const Blame blame = FindBlame(records);
  for (const JobRecord& record : records) {
    if (!IsTerminal(record.state)) TakeUp(record, blame);
  }
  retention_.Begin();
  if (load().queued_jobs > 0) scheduler_.CheckStorage();
  if (environment_.watch != nullptr) watchdog_.Begin();
  scheduler_.EndBegin();
}

Blame JobManager::FindBlame(const std::vector<JobRecord>& records) {
  if (environment_.traces == nullptr) return {};
  std::vector<JobRecord> ran;
  for (const JobRecord& record : records) {
    if (record.state == JobState::kRunning) ran.push_back(record);
  }
  Blame blame = WhoIsToBlame(environment_.traces->Read(), ran);
  environment_.traces->Write({});  // it says nothing about what comes now
  return blame;
}

void JobManager::TakeUp(const JobRecord& record, const Blame& blame) {
  const JobLimits& limits = environment_.limits;
  const std::int64_t budget_bytes = environment_.budget->total_bytes();
  const bool ran = record.state == JobState::kRunning;
  const bool is_to_blame = blame.jobs.count(record.id) != 0;
  const std::int32_t faults = record.faults + (is_to_blame ? 1 : 0);
  // What another job did is no attempt of this one.
  const std::int32_t attempt =
      record.attempt - (ran && blame.is_known && !is_to_blame ? 1 : 0);
  if (faults >= limits.max_faults) {
    return (void)lifecycle_.Fail(record, CrashedRepeatedly(faults));
  }
  if (ran && attempt >= limits.max_attempts) {
    return (void)lifecycle_.Fail(record, CrashedRepeatedly(attempt));
  }
  if (record.memory_estimate_bytes > budget_bytes) {
    return (void)lifecycle_.Fail(
        record, JobNeedsMoreMemoryThanBudget(record.memory_estimate_bytes,
                                             budget_bytes));
  }
  if (record.cancel_when_unwatched) lifecycle_.guard().Guard(record.id);
  if (!ran) return scheduler_.Enqueue(record);
  const auto queued =
      lifecycle_.Move(record.id, JobState::kQueued, [&](JobRecord& again) {
        again.faults = faults;
        again.attempt = attempt;
        return absl::OkStatus();
      });
  if (queued.ok()) scheduler_.Enqueue(*queued);
}

// Asking.

absl::StatusOr<JobSnapshot> JobManager::Get(const Caller& caller,
                                            const std::string& id) const {
  ISOMATCH_ASSIGN_OR_RETURN(JobRecord record, lifecycle_.Find(caller, id));
  return scheduler_.SnapshotOf(std::move(record));
}

absl::StatusOr<std::vector<JobSnapshot>> JobManager::List(
    const Caller& caller, JobFilter filter) const {
  if (caller.role != Role::kAdmin) filter.tenant = caller.tenant;
  auto records = environment_.jobs->List(filter);
  if (!records.ok()) return StorageSilent(records.status());
  std::vector<JobSnapshot> snapshots;
  for (JobRecord& record : *records) {
    snapshots.push_back(scheduler_.SnapshotOf(std::move(record)));
  }
  return snapshots;
}

absl::StatusOr<JobPart> JobManager::GetPart(const Caller& caller,
                                            const std::string& id,
                                            ResultPart part) const {
  ISOMATCH_ASSIGN_OR_RETURN(const JobRecord record,
                            lifecycle_.Find(caller, id));
  if (record.state != JobState::kSucceeded) {
    return JobHasNoResult(id, record.state);
  }
  const StoredPart* const stored = FindPart(*record.result, part);
  if (stored == nullptr) return ResultPartMissing(id, part);
  auto bytes = environment_.blobs->Get({record.tenant, stored->sha256});
  if (bytes.ok()) return JobPart{*record.result, *stored, *std::move(bytes)};
  if (!absl::IsNotFound(bytes.status())) {
    return ContentUnavailable("result", bytes.status());
  }
  // Deleted a moment ago, unless it still is there.
  ISOMATCH_RETURN_IF_ERROR(lifecycle_.Find(caller, id).status());
  return ContentLost(id, "result");
}

// Ending.

absl::StatusOr<JobSnapshot> JobManager::Cancel(const Caller& caller,
                                               const std::string& id) {
  ISOMATCH_RETURN_IF_ERROR(lifecycle_.Find(caller, id).status());
  ISOMATCH_RETURN_IF_ERROR(scheduler_.Stop(id, JobState::kCancelled));
  return Get(caller, id);
}

absl::Status JobManager::Delete(const Caller& caller, const std::string& id) {
  ISOMATCH_ASSIGN_OR_RETURN(const JobRecord record,
                            lifecycle_.Find(caller, id));
  auto removed = environment_.jobs->Delete(id);
  if (absl::IsNotFound(removed.status())) return JobNotFound(id);
  if (absl::IsFailedPrecondition(removed.status())) {
    return JobIsNotTerminal(id, record.state);
  }
  if (!removed.ok()) return StorageFailed(removed.status());
  retention_.OnDeleted(*removed);
  watchers().Notify(id);
  return absl::OkStatus();
}

void JobManager::BeginDrain() {
  disk_.Stop();
  retention_.Stop();
  scheduler_.BeginDrain();
  if (environment_.shared != nullptr) member_.Leave();
}

void JobManager::Shutdown(absl::Duration drain) {
  BeginDrain();
  if (!scheduler_.WaitUntilIdle(drain)) {
    // One that has its worker but does not run yet hears of it when it does.
    for (const std::string& id : scheduler_.LiveIds()) StopRunning(id);
    if (!scheduler_.WaitUntilIdle(environment_.limits.unresponsive_grace)) {
      for (const std::string& id : scheduler_.runs().Ids()) {
        watchdog_.OnNoAnswer(id);
      }
      scheduler_.WaitUntilIdle(kLastAnswers);
    }
  }
  lifecycle_.guard().ReleaseAll();
  environment_.jobs->Flush();
  stopped_ = true;
  watchdog_.Stop();
  member_.Stop();
  watchers().NotifyAll();
}

void JobManager::StopRunning(const std::string& id) {
  if (environment_.limits.durable) {
    scheduler_.AskToStop(id);  // it goes back to the queue when it answers
  } else {
    (void)scheduler_.Stop(id, JobState::kCancelled);
  }
}

}  // namespace isomatch
