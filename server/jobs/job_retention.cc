#include "server/jobs/job_retention.h"

#include <utility>

#include "server/jobs/within_memory.h"

namespace isomatch {
namespace {

/// How often jobs are looked through for those that are too old.
constexpr absl::Duration kRetentionInterval = absl::Minutes(1);

}  // namespace

void JobRetention::ForgetOld() {
  // The next time first: memory may end.
  Executor::Timer next = environment_.timers->PostAfter(
      kRetentionInterval, [this] { disk_.Run([this] { ForgetOld(); }); });
  {
    MutexLock lock(mutex_);
    if (!is_stopped_) std::swap(timer_, next);
  }
  environment_.jobs->Flush();
  Prune();
}

void JobRetention::Stop() {
  Executor::Timer timer;  // dropped after the lock
  MutexLock lock(mutex_);
  is_stopped_ = true;
  timer = std::move(timer_);
}

void JobRetention::Pin(const JobRecord& record) {
  if (record.result) {
    for (const StoredPart& part : record.result->parts) {
      environment_.blobs->PinWhenThere({record.tenant, part.sha256});
    }
  }
  if (IsTerminal(record.state)) return;
  for (const std::string& sha256 : record.inputs) {
    environment_.blobs->PinWhenThere({record.tenant, sha256});
  }
}

void JobRetention::UnpinInputs(const JobRecord& record) {
  for (const std::string& sha256 : record.inputs) {
    WhenThereIsMemory([&] {
      environment_.blobs->Unpin({record.tenant, sha256});
    });
  }
}

void JobRetention::RemoveParts(const std::string& tenant,
                               const std::vector<StoredPart>& parts) {
  for (const StoredPart& part : parts) {
    const BlobKey key = {tenant, part.sha256};
    environment_.blobs->Unpin(key);
    environment_.blobs->Remove(key);
  }
}

void JobRetention::Prune(std::int64_t room_bytes) {
  const JobLimits& limits = environment_.limits;
  const auto removed = environment_.jobs->Prune(
      {.max_jobs = limits.max_kept_jobs,
       .max_jobs_per_tenant = limits.tenant.kept_jobs,
       .max_result_bytes = limits.max_result_bytes,
       .ended_before = environment_.BelievedTime() - limits.job_retention,
       .ended_before_steady = environment_.uptime() - limits.job_retention,
       .room_bytes = room_bytes});
  // A store that others share looks after what they leave.
  if (removed.ok() && environment_.shared == nullptr) RemoveResults(*removed);
}

void JobRetention::RemoveResults(const std::vector<JobRecord>& removed) {
  for (const JobRecord& record : removed) {
    if (record.result) RemoveParts(record.tenant, record.result->parts);
    if (record.inputs.empty()) continue;
    environment_.blobs->Remove({record.tenant, record.inputs.front()});
  }
}

void JobRetention::OnDeleted(const JobRecord& removed) {
  RemoveResults({removed});
  for (size_t i = 1; i < removed.inputs.size(); ++i) {
    const std::string& mesh = removed.inputs[i];
    const auto is_named = environment_.jobs->HasInput(removed.tenant, mesh);
    if (!is_named.ok() || *is_named) continue;
    environment_.blobs->Remove({removed.tenant, mesh});
  }
}

}  // namespace isomatch
