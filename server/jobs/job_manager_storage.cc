// The part of JobManager that lets jobs wait for the disk, and gives room back.

#include <algorithm>
#include <utility>

#include "core/base/status_macros.h"
#include "server/jobs/errors.h"
#include "server/jobs/job_manager.h"

namespace isomatch {
namespace {

// How long a job whose inputs could not be read waits: twice as long each time.
constexpr absl::Duration kFirstHold = absl::Seconds(1);
constexpr absl::Duration kLongestHold = absl::Seconds(30);

absl::Duration HoldAfter(int times_held) {
  absl::Duration hold = kFirstHold;
  for (int i = 0; i < times_held && hold < kLongestHold; ++i) hold *= 2;
  return std::min(hold, kLongestHold);
}

}  // namespace

StorageGate::Parts JobManager::MakeGateParts() {
  return {.timers = parts_.timers,
          .probe =
              [this](std::int64_t bytes) {
                return parts_.blobs->TryWriting(bytes);
              },
          .on_change =
              [this](const absl::Status& storage) {
                if (parts_.on_storage) parts_.on_storage(storage);
                if (storage.ok()) Dispatch();
              }};
}

bool JobManager::WaitForStorage(const JobRecord& record,
                                std::int64_t result_bytes,
                                const absl::Status& error) {
  // Where only what jobs need is in the way, waiting could be for ever: some
  // have to give way.
  const bool is_refused =
      IsStorageFailed(error) && parts_.blobs->CanMakeRoom(result_bytes);
  if (!is_refused && !IsContentUnavailable(error)) return false;
  if (is_refused) gate_.Close(result_bytes, error);
  return Move(record.id, JobState::kQueued,
              [&](JobRecord& now) {
                if (now.state != record.state) {
                  return absl::FailedPreconditionError("too late");
                }
                --now.attempt;  // it was not the job's fault
                return absl::OkStatus();
              })
      .ok();
}

void JobManager::Hold(const std::shared_ptr<LiveJob>& live) {
  live->is_held = true;
  live->timer = parts_.timers->PostAfter(
      HoldAfter(live->times_held++),
      [this, weak = std::weak_ptr<LiveJob>(live)] { LetStart(weak); });
}

void JobManager::LetStart(const std::weak_ptr<LiveJob>& weak) {
  const std::shared_ptr<LiveJob> live = weak.lock();
  if (live == nullptr) return;
  {
    MutexLock lock(mutex_);
    queue_.EndHold(*live);
  }
  Dispatch();
}

void JobManager::Prune() {
  RetentionClock* const clock = parts_.retention_clock;
  const bool is_believed = clock == nullptr || clock->IsBelieved();
  Forget(parts_.jobs->Prune(
      {.max_jobs = limits_.max_kept_jobs,
       .max_jobs_per_tenant = limits_.tenant.kept_jobs,
       .max_result_bytes = limits_.max_result_bytes,
       .ended_before = is_believed ? parts_.now() - limits_.job_retention
                                   : absl::InfinitePast()}));
}

void JobManager::Forget(const std::vector<JobRecord>& removed) {
  for (const JobRecord& record : removed) {
    if (record.result) {
      UnpinParts(record.tenant, *record.result);
      for (const StoredPart& part : record.result->parts) {
        parts_.blobs->Remove({record.tenant, part.sha256});
      }
    }
    if (record.inputs.empty()) continue;
    parts_.blobs->Remove({record.tenant, record.inputs.front()});
  }
}

void JobManager::RemoveMeshes(const JobRecord& removed) {
  for (size_t i = 1; i < removed.inputs.size(); ++i) {
    const std::string& sha256 = removed.inputs[i];
    if (parts_.jobs->HasInput(removed.tenant, sha256)) continue;
    parts_.blobs->Remove({removed.tenant, sha256});
  }
}

}  // namespace isomatch
