// The part of JobManager that lets jobs wait for the disk, and gives room back.

#include <algorithm>
#include <chrono>
#include <functional>
#include <utility>

#include "core/base/status_macros.h"
#include "server/jobs/errors.h"
#include "server/jobs/job_manager.h"
#include "server/jobs/within_memory.h"

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

/// How often in a row the inputs may be unreadable: for an hour.
constexpr int kMostUnreadable = 124;

}  // namespace

StorageGate::Parts JobManager::MakeGateParts() {
  return {.timers = parts_.timers,
          .on_disk =
              [this](std::function<void()> work) { OnDisk(std::move(work)); },
          .probe = [this] { return parts_.blobs->TryWriting(0); },
          .on_change =
              [this](const absl::Status& storage) {
                // Nothing else lets the jobs start that wait.
                WhenThereIsMemory([&] {
                  if (parts_.on_storage) parts_.on_storage(storage);
                });
                if (storage.ok()) WhenThereIsMemory([&] { Dispatch(); });
              }};
}

void JobManager::OnDisk(std::function<void()> work) {
  if (parts_.disk == nullptr) return work();
  MutexLock lock(mutex_);  // nothing comes behind BeginDrain
  if (!draining_) parts_.disk->Post(std::move(work));
}

bool JobManager::WaitForStorage(LiveJob& live, const JobRecord& record,
                                std::int64_t result_bytes,
                                const absl::Status& error) {
  // Where only what jobs need is in the way, waiting could be for ever: some
  // have to give way.
  const bool is_refused =
      IsStorageFailed(error) && parts_.blobs->CanMakeRoom(result_bytes);
  const bool is_unreadable = IsContentUnavailable(error);
  live.awaited_bytes = is_refused ? result_bytes : 0;
  live.unreadable = is_unreadable ? live.unreadable + 1 : 0;
  if (!is_refused && !is_unreadable) return false;
  if (is_refused) (void)gate_.Check();
  if (live.unreadable > kMostUnreadable) {
    Fail(record, ContentLost(record.id, DetailsOf(error).metadata["what"]));
    return true;
  }
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
  live->timer = HoldTimer(live, live->times_held++);
}

Executor::Timer JobManager::HoldTimer(const std::shared_ptr<LiveJob>& live,
                                      int times_held) {
  return parts_.timers->PostAfter(
      HoldAfter(times_held),
      [this, weak = std::weak_ptr<LiveJob>(live)] { LetStart(weak); });
}

bool JobManager::IsHeldLocked(const std::shared_ptr<LiveJob>& live) const {
  const auto found = live_.find(live->id);
  return found != live_.end() && found->second == live && live->is_held;
}

void JobManager::LetStart(const std::weak_ptr<LiveJob>& weak) {
  const std::shared_ptr<LiveJob> live = weak.lock();
  if (live == nullptr) return;
  std::int64_t bytes = 0;
  int times_held = 0;
  {
    MutexLock lock(mutex_);
    if (!IsHeldLocked(live)) return;
    bytes = live->awaited_bytes;
    if (bytes > 0) times_held = live->times_held++;
  }
  if (bytes == 0) return EndHold(*live);
  // The next time first: this one may be lost.
  Executor::Timer next = HoldTimer(live, times_held);
  {
    MutexLock lock(mutex_);
    if (IsHeldLocked(live)) std::swap(live->timer, next);
  }
  if (!gate_.is_open()) return;
  OnDisk([this, weak, bytes] {
    const std::shared_ptr<LiveJob> waiting = weak.lock();
    if (waiting == nullptr || !parts_.blobs->TryWriting(bytes).ok()) return;
    EndHold(*waiting);
  });
}

void JobManager::EndHold(LiveJob& live) {
  {
    MutexLock lock(mutex_);
    queue_.EndHold(live);
    live.awaited_bytes = 0;
  }
  WhenThereIsMemory([&] { Dispatch(); });
}

absl::Time JobManager::BelievedTime() const {
  RetentionClock* const clock = parts_.retention_clock;
  return clock == nullptr ? parts_.now() : clock->Now();
}

absl::Duration JobManager::Uptime() const {
  return parts_.uptime
             ? parts_.uptime()
             : absl::FromChrono(
                   std::chrono::steady_clock::now().time_since_epoch());
}

void JobManager::Prune(std::int64_t room_bytes) {
  Forget(parts_.jobs->Prune(
      {.max_jobs = limits_.max_kept_jobs,
       .max_jobs_per_tenant = limits_.tenant.kept_jobs,
       .max_result_bytes = limits_.max_result_bytes,
       .ended_before = BelievedTime() - limits_.job_retention,
       .ended_before_steady = Uptime() - limits_.job_retention,
       .room_bytes = room_bytes}));
}

void JobManager::RemoveParts(const std::string& tenant,
                             const JobResult& result) {
  for (const StoredPart& part : result.parts) {
    const BlobKey key = {tenant, part.sha256};
    parts_.blobs->Unpin(key);
    parts_.blobs->Remove(key);
  }
}

void JobManager::Forget(const std::vector<JobRecord>& removed) {
  for (const JobRecord& record : removed) {
    if (record.result) RemoveParts(record.tenant, *record.result);
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
