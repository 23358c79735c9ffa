// The part of JobManager that takes up the jobs of an earlier process.

#include <algorithm>
#include <limits>
#include <utility>

#include "server/jobs/errors.h"
#include "server/jobs/job_manager.h"

namespace isomatch {

void JobManager::Begin() {
  JobFilter all;
  all.limit = std::numeric_limits<int>::max();
  std::vector<JobRecord> records = parts_.jobs->List(all);
  std::reverse(records.begin(), records.end());  // the oldest first
  {
    MutexLock lock(mutex_);
    is_beginning_ = true;
  }
  // All pins before anything is stored or forgotten.
  for (const JobRecord& record : records) PinBlobs(record);
  const Blame blame = FindBlame(records);
  for (const JobRecord& record : records) {
    if (IsTerminal(record.state)) continue;
    TakeUp(record, blame);
  }
  ForgetOld();
  if (load().queued_jobs > 0) (void)gate_.Check();
  if (parts_.watch != nullptr) Watch();
  {
    MutexLock lock(mutex_);
    is_beginning_ = false;
  }
  Dispatch();
}

Blame JobManager::FindBlame(const std::vector<JobRecord>& records) {
  if (parts_.traces == nullptr) return {};
  std::vector<JobRecord> ran;
  for (const JobRecord& record : records) {
    if (record.state == JobState::kRunning) ran.push_back(record);
  }
  Blame blame = WhoIsToBlame(parts_.traces->Read(), ran);
  parts_.traces->Write({});  // it says nothing about what comes now
  return blame;
}

void JobManager::PinBlobs(const JobRecord& record) {
  if (record.result) {
    for (const StoredPart& part : record.result->parts) {
      parts_.blobs->PinWhenThere({record.tenant, part.sha256});
    }
  }
  if (IsTerminal(record.state)) return;
  for (const std::string& sha256 : record.inputs) {
    parts_.blobs->PinWhenThere({record.tenant, sha256});
  }
}

void JobManager::TakeUp(const JobRecord& record, const Blame& blame) {
  const std::int64_t budget_bytes = parts_.budget->total_bytes();
  const bool ran = record.state == JobState::kRunning;
  const bool is_to_blame = blame.jobs.count(record.id) != 0;
  const std::int32_t faults = record.faults + (is_to_blame ? 1 : 0);
  // What another job did is no attempt of this one.
  const std::int32_t attempt =
      record.attempt - (ran && blame.is_known && !is_to_blame ? 1 : 0);
  if (faults >= limits_.max_faults) {
    return Fail(record, CrashedRepeatedly(faults));
  }
  if (ran && attempt >= limits_.max_attempts) {
    return Fail(record, CrashedRepeatedly(attempt));
  }
  if (record.memory_estimate_bytes > budget_bytes) {
    return Fail(record, JobNeedsMoreMemoryThanBudget(
                            record.memory_estimate_bytes, budget_bytes));
  }
  if (record.cancel_when_unwatched) guard_.Guard(record.id);
  if (!ran) return Enqueue(record);
  const auto queued = Move(record.id, JobState::kQueued, [&](JobRecord& again) {
    again.faults = faults;
    again.attempt = attempt;
    return absl::OkStatus();
  });
  if (queued.ok()) Enqueue(*queued);
}

}  // namespace isomatch
