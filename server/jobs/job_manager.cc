#include "server/jobs/job_manager.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/jobs/errors.h"
#include "server/storage/sha256.h"

namespace isomatch {
namespace {

// What a client is told to wait before it tries again.
constexpr absl::Duration kRetryQueueFull = absl::Seconds(5);
constexpr absl::Duration kRetryDraining = absl::Seconds(10);

bool CanMove(JobState from, JobState to) {
  if (from == JobState::kQueued) {
    return to == JobState::kRunning || to == JobState::kFailed ||
           to == JobState::kCancelled;
  }
  return from == JobState::kRunning && IsTerminal(to);
}

absl::Status NoEdit(JobRecord&) { return absl::OkStatus(); }

JobError ErrorOf(const absl::Status& status) {
  return {status.code(), DetailsOf(status).reason,
          std::string(status.message())};
}

}  // namespace

JobManager::JobManager(const Limits& limits, const Parts& parts)
    : limits_(limits), parts_(parts), queue_(limits.max_passes) {}

// Asking.

absl::StatusOr<std::optional<JobSnapshot>> JobManager::FindRequest(
    const std::string& request_id, const std::string& request_sha256) const {
  if (request_id.empty()) return std::nullopt;
  auto record = parts_.jobs->FindByRequestId(request_id);
  if (!record) return std::nullopt;
  if (record->request_sha256 != request_sha256) {
    return RequestIdReused(request_id);
  }
  return SnapshotOf(*std::move(record));
}

absl::StatusOr<JobSnapshot> JobManager::Get(const std::string& id) const {
  auto record = parts_.jobs->Get(id);
  if (!record) return JobNotFound(id);
  return SnapshotOf(*std::move(record));
}

std::vector<JobSnapshot> JobManager::List(const JobFilter& filter) const {
  std::vector<JobSnapshot> snapshots;
  for (JobRecord& record : parts_.jobs->List(filter)) {
    snapshots.push_back(SnapshotOf(std::move(record)));
  }
  return snapshots;
}

absl::StatusOr<JobPart> JobManager::GetPart(const std::string& id,
                                            ResultPart part) const {
  auto record = parts_.jobs->Get(id);
  if (!record) return JobNotFound(id);
  if (record->state != JobState::kSucceeded) {
    return JobHasNoResult(id, record->state);
  }
  const StoredPart* const stored = FindPart(*record->result, part);
  if (stored == nullptr) return ResultPartMissing(id, part);
  BlobStore::Blob bytes = parts_.blobs->Get(stored->sha256);
  if (bytes == nullptr) return JobNotFound(id);  // deleted a moment ago
  return JobPart{*record->result, *stored, std::move(bytes)};
}

JobManager::Load JobManager::load() const {
  MutexLock lock(mutex_);
  return {queue_.size(), running_, draining_};
}

JobSnapshot JobManager::SnapshotOf(JobRecord record) const {
  JobSnapshot snapshot{std::move(record), 0};
  if (snapshot.record.state == JobState::kQueued) {
    MutexLock lock(mutex_);
    snapshot.queue_position = queue_.JobsAhead(snapshot.record.id);
  }
  return snapshot;
}

// A job's way in.

absl::StatusOr<JobSnapshot> JobManager::Create(JobSpec spec) {
  ISOMATCH_ASSIGN_OR_RETURN(std::optional<JobSnapshot> before,
                            FindRequest(spec.request_id, spec.request_sha256));
  if (before) return *std::move(before);
  const auto live = MakeLive(std::move(spec));
  const std::int64_t budget_bytes = parts_.budget->total_bytes();
  if (live->memory_estimate_bytes > budget_bytes) {
    return JobNeedsMoreMemoryThanBudget(live->memory_estimate_bytes,
                                        budget_bytes);
  }
  if (live->spec.validate_only) return JobSnapshot{NewRecord(*live), 0};
  live->id = parts_.new_id();
  return Accept(live);
}

std::shared_ptr<LiveJob> JobManager::MakeLive(JobSpec spec) const {
  auto live = std::make_shared<LiveJob>();
  live->mesh_bytes = MeshBytes(spec);
  live->memory_estimate_bytes = parts_.runner->EstimateBytes(spec);
  live->spec = std::move(spec);
  return live;
}

JobRecord JobManager::NewRecord(const LiveJob& live) const {
  JobRecord record;
  record.id = live.id;
  record.memory_estimate_bytes = live.memory_estimate_bytes;
  record.create_time = parts_.now();
  record.labels = live.spec.labels;
  record.request_id = live.spec.request_id;
  record.request_sha256 = live.spec.request_sha256;
  return record;
}

absl::StatusOr<JobSnapshot> JobManager::Accept(
    const std::shared_ptr<LiveJob>& live) {
  ISOMATCH_RETURN_IF_ERROR(TakePlace(*live));
  const auto inserted = parts_.jobs->Insert(NewRecord(*live));
  if (!inserted.ok()) {
    GivePlaceBack(*live);
    // The same request may have come twice at the same time.
    ISOMATCH_ASSIGN_OR_RETURN(
        std::optional<JobSnapshot> other,
        FindRequest(live->spec.request_id, live->spec.request_sha256));
    if (other) return *std::move(other);
    return inserted.status();
  }
  if (parts_.on_state) parts_.on_state(*inserted);
  const std::string id = live->id;
  Enqueue(live);
  return Get(id);
}

absl::Status JobManager::TakePlace(const LiveJob& live) {
  MutexLock lock(mutex_);
  if (draining_) return Draining(kRetryDraining);
  const int waiting = queue_.size() + arriving_;
  const std::int64_t free_bytes =
      parts_.budget->total_bytes() / 4 - queue_.mesh_bytes() - arriving_bytes_;
  if (waiting >= limits_.max_queued_jobs ||
      (waiting > 0 && live.mesh_bytes > free_bytes)) {
    return QueueFull(waiting, kRetryQueueFull);
  }
  ++arriving_;
  arriving_bytes_ += live.mesh_bytes;
  return absl::OkStatus();
}

void JobManager::GivePlaceBack(const LiveJob& live) {
  MutexLock lock(mutex_);
  --arriving_;
  arriving_bytes_ -= live.mesh_bytes;
}

void JobManager::Enqueue(const std::shared_ptr<LiveJob>& live) {
  const std::string id = live->id;
  if (const auto limit = live->spec.queue_timeout) {
    live->timer = parts_.timers->PostAfter(*limit, [this, id, limit] {
      FailIfStill(JobState::kQueued, id, QueueTimeout(*limit));
    });
  }
  bool too_late = false;
  {
    MutexLock lock(mutex_);
    --arriving_;
    arriving_bytes_ -= live->mesh_bytes;
    too_late = draining_;
    live_[id] = live;
    queue_.Push(live);
  }
  if (too_late) (void)Stop(id, JobState::kCancelled, NoEdit);
  Dispatch();
}

// Running it.

void JobManager::Dispatch() {
  while (std::shared_ptr<LiveJob> live = TakeNext()) {
    parts_.workers->Post(
        [this, live = std::move(live)]() mutable { Run(std::move(live)); });
  }
}

std::shared_ptr<LiveJob> JobManager::TakeNext() {
  MutexLock lock(mutex_);
  if (running_ >= limits_.workers) return nullptr;
  std::shared_ptr<LiveJob> live = queue_.PopFitting(*parts_.budget);
  if (live != nullptr) ++running_;
  return live;
}

void JobManager::Run(std::shared_ptr<LiveJob> live) {
  const std::string id = live->id;
  if (Start(*live).ok()) {
    Finish(id,
           parts_.runner->Run(
               live->spec, [&](const JobProgress& p) { ReportProgress(id, p); },
               live->stop.get_token()));
  }
  ReleaseSlot(std::move(live));
  Dispatch();
}

absl::Status JobManager::Start(LiveJob& live) {
  live.timer.reset();
  ISOMATCH_RETURN_IF_ERROR(
      Move(live.id, JobState::kRunning, [&](JobRecord& record) {
        record.start_time = parts_.now();
        return absl::OkStatus();
      }));
  if (const auto limit = live.spec.run_timeout) {
    live.timer = parts_.timers->PostAfter(*limit, [this, id = live.id, limit] {
      FailIfStill(JobState::kRunning, id, RunTimeout(*limit));
    });
  }
  return absl::OkStatus();
}

void JobManager::ReportProgress(const std::string& id,
                                const JobProgress& progress) {
  (void)Change(id, [&](JobRecord& record) {
    if (IsTerminal(record.state)) return JobIsTerminal(id, record.state);
    record.progress = progress;
    return absl::OkStatus();
  });
}

void JobManager::Finish(const std::string& id,
                        absl::StatusOr<RunOutcome> outcome) {
  absl::Status status = outcome.status();
  if (status.ok()) status = Succeed(id, *std::move(outcome));
  if (!status.ok()) Fail(id, status);
}

absl::Status JobManager::Succeed(const std::string& id, RunOutcome outcome) {
  JobResult& result = outcome.result;
  ISOMATCH_RETURN_IF_ERROR(StoreParts(std::move(outcome.parts), result));
  const absl::Status moved =
      Move(id, JobState::kSucceeded, [&](JobRecord& record) {
        record.result = result;
        record.progress.stage_fraction = 1;
        record.progress.total_fraction = 1;
        return absl::OkStatus();
      });
  if (!moved.ok()) UnpinParts(result);
  return moved;
}

absl::Status JobManager::StoreParts(std::vector<EncodedPart> parts,
                                    JobResult& result) {
  for (EncodedPart& part : parts) {
    StoredPart stored{part.part, Sha256Hex(part.bytes),
                      static_cast<std::int64_t>(part.bytes.size())};
    const absl::Status put =
        parts_.blobs->Put(stored.sha256, std::move(part.bytes), Keep::kPinned);
    if (!put.ok()) {
      UnpinParts(result);
      return OutOfMemory();
    }
    result.parts.push_back(std::move(stored));
  }
  return absl::OkStatus();
}

void JobManager::Fail(const std::string& id, const absl::Status& error) {
  if (absl::IsCancelled(error)) {
    (void)Move(id, JobState::kCancelled, NoEdit);
    return;
  }
  // Refused when the job was cancelled or timed out before: that is what it is.
  (void)Move(id, JobState::kFailed, [&](JobRecord& record) {
    record.error = ErrorOf(error);
    return absl::OkStatus();
  });
}

void JobManager::ReleaseSlot(std::shared_ptr<LiveJob> live) {
  live->Release();  // before the slot, so that the next job finds the memory
  MutexLock lock(mutex_);
  live_.erase(live->id);
  --running_;
  idle_.NotifyAll();
}

// Ending it early.

absl::StatusOr<JobSnapshot> JobManager::Cancel(const std::string& id) {
  ISOMATCH_RETURN_IF_ERROR(Stop(id, JobState::kCancelled, NoEdit));
  return Get(id);
}

absl::Status JobManager::Delete(const std::string& id) {
  auto removed = parts_.jobs->Delete(id);
  if (absl::IsNotFound(removed.status())) return JobNotFound(id);
  if (!removed.ok()) {
    ISOMATCH_ASSIGN_OR_RETURN(const JobSnapshot now, Get(id));
    return JobIsNotTerminal(id, now.record.state);
  }
  Forget({*std::move(removed)});
  watchers_.Notify(id);
  return absl::OkStatus();
}

absl::Status JobManager::Stop(const std::string& id, JobState to,
                              const Edit& edit) {
  ISOMATCH_RETURN_IF_ERROR(Move(id, to, edit));
  std::shared_ptr<LiveJob> live;
  std::shared_ptr<LiveJob> queued;
  {
    MutexLock lock(mutex_);
    const auto found = live_.find(id);
    if (found == live_.end()) return absl::OkStatus();
    live = found->second;
    queued = queue_.Remove(id);
    if (queued != nullptr) live_.erase(found);
  }
  live->stop.request_stop();
  if (queued != nullptr) {
    queued->Release();
    Dispatch();  // it may have stood in the way of others
  }
  return absl::OkStatus();
}

void JobManager::FailIfStill(JobState state, const std::string& id,
                             const absl::Status& error) {
  (void)Stop(id, JobState::kFailed, [&](JobRecord& record) {
    if (record.state != state) return absl::FailedPreconditionError("too late");
    record.error = ErrorOf(error);
    return absl::OkStatus();
  });
}

void JobManager::BeginDrain() {
  {
    MutexLock lock(mutex_);
    draining_ = true;
  }
  while (true) {
    std::shared_ptr<LiveJob> queued;
    {
      MutexLock lock(mutex_);
      queued = queue_.PopFront();
      if (queued != nullptr) live_.erase(queued->id);
    }
    if (queued == nullptr) return;
    (void)Move(queued->id, JobState::kCancelled, NoEdit);
    queued->Release();
  }
}

void JobManager::Shutdown(absl::Duration drain) {
  BeginDrain();
  if (WaitUntilIdle(drain)) return;
  for (const std::string& id : LiveIds()) {
    (void)Stop(id, JobState::kCancelled, NoEdit);
  }
  WaitUntilIdle(absl::InfiniteDuration());
}

bool JobManager::WaitUntilIdle(absl::Duration timeout) {
  const auto deadline =
      std::chrono::steady_clock::now() +
      absl::ToChronoMilliseconds(std::min(timeout, absl::Hours(24 * 365)));
  MutexLock lock(mutex_);
  while (running_ > 0) {
    if (!idle_.WaitUntil(mutex_, deadline)) return running_ == 0;
  }
  return true;
}

std::vector<std::string> JobManager::LiveIds() const {
  std::vector<std::string> ids;
  MutexLock lock(mutex_);
  for (const auto& [id, live] : live_) ids.push_back(id);
  return ids;
}

// Changing it.

absl::Status JobManager::Move(const std::string& id, JobState to,
                              const Edit& edit) {
  ISOMATCH_ASSIGN_OR_RETURN(const JobRecord moved,
                            Change(id, [&](JobRecord& record) {
                              if (!CanMove(record.state, to))
                                return JobIsTerminal(id, record.state);
                              ISOMATCH_RETURN_IF_ERROR(edit(record));
                              record.state = to;
                              if (IsTerminal(to))
                                record.end_time = parts_.now();
                              return absl::OkStatus();
                            }));
  if (parts_.on_state) parts_.on_state(moved);
  if (IsTerminal(to)) {
    Forget(parts_.jobs->Prune(limits_.max_kept_jobs, limits_.max_result_bytes));
  }
  return absl::OkStatus();
}

absl::StatusOr<JobRecord> JobManager::Change(const std::string& id,
                                             const Edit& edit) {
  while (true) {
    std::optional<JobRecord> record = parts_.jobs->Get(id);
    if (!record) return JobNotFound(id);
    ISOMATCH_RETURN_IF_ERROR(edit(*record));
    auto changed = parts_.jobs->Update(*std::move(record));
    if (changed.ok()) watchers_.Notify(id);
    if (!absl::IsAborted(changed.status())) return changed;
  }
}

void JobManager::UnpinParts(const JobResult& result) {
  for (const StoredPart& part : result.parts) parts_.blobs->Unpin(part.sha256);
}

void JobManager::Forget(const std::vector<JobRecord>& removed) {
  for (const JobRecord& record : removed) {
    if (record.result) UnpinParts(*record.result);
  }
}

}  // namespace isomatch
