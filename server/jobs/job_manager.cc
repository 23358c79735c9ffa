#include "server/jobs/job_manager.h"

#include <algorithm>
#include <new>
#include <utility>

#include "core/base/status_macros.h"
#include "server/jobs/errors.h"
#include "server/jobs/within_memory.h"

namespace isomatch {
namespace {

// What a client is told to wait before it tries again.
constexpr absl::Duration kRetryQueueFull = absl::Seconds(5);
constexpr absl::Duration kRetryDraining = absl::Seconds(10);

/// How often jobs are looked through for those that are too old.
constexpr absl::Duration kRetentionInterval = absl::Minutes(1);

/// Starts of a job after which it runs alone: the server went down with it each
/// time, and nothing told whose fault it was.
constexpr int kAloneAfter = 3;

bool CanMove(JobState from, JobState to) {
  if (from == JobState::kQueued) {
    return to == JobState::kRunning || to == JobState::kFailed ||
           to == JobState::kCancelled;
  }
  return from == JobState::kRunning &&
         (IsTerminal(to) || to == JobState::kQueued);
}

/// As if it had not been started; but it was, and in time.
void Rewind(JobRecord& record) {
  record.queue_timeout.reset();
  record.progress = JobProgress();
  record.start_time = absl::InfinitePast();
}

}  // namespace

/// Made before the lock is taken: what goes wrong on the way gives back what
/// was taken, under the lock.
class JobManager::Seat {
 public:
  Seat(JobManager* manager, std::string tenant)
      : manager_(manager), tenant_(std::move(tenant)) {}
  Seat(const Seat&) = delete;
  Seat& operator=(const Seat&) = delete;
  ~Seat() {
    if (is_taken_) manager_->GivePlaceBack(tenant_);
  }

  const std::string& tenant() const { return tenant_; }
  void SetTaken() { is_taken_ = true; }

 private:
  JobManager* const manager_;
  const std::string tenant_;
  bool is_taken_ = false;
};

JobManager::JobManager(const Limits& limits, const Parts& parts)
    : limits_(limits),
      parts_(parts),
      gate_(MakeGateParts()),
      guard_(limits.unwatched_grace, parts.timers, &watchers_,
             [this](const std::string& id) {
               (void)Stop(id, JobState::kCancelled);
             }),
      queue_(limits.max_passes, limits.tenant.running_jobs),
      threads_(limits.workers),
      runs_([this] { return Uptime(); }) {}

// Asking.

absl::StatusOr<JobRecord> JobManager::Find(const Caller& caller,
                                           const std::string& id) const {
  std::optional<JobRecord> record = parts_.jobs->Get(id);
  const bool may_know = record && (caller.role == Role::kAdmin ||
                                   caller.tenant == record->tenant);
  if (!may_know) return JobNotFound(id);
  return *std::move(record);
}

absl::StatusOr<std::optional<JobSnapshot>> JobManager::FindRequest(
    const Caller& caller, const std::string& request_id,
    const std::string& request_sha256) const {
  if (request_id.empty()) return std::nullopt;
  auto record = parts_.jobs->FindByRequestId(caller.tenant, request_id);
  if (!record) return std::nullopt;
  if (record->request_sha256 != request_sha256) {
    return RequestIdReused(request_id);
  }
  return SnapshotOf(*std::move(record));
}

absl::StatusOr<JobSnapshot> JobManager::Get(const Caller& caller,
                                            const std::string& id) const {
  ISOMATCH_ASSIGN_OR_RETURN(JobRecord record, Find(caller, id));
  return SnapshotOf(std::move(record));
}

std::vector<JobSnapshot> JobManager::List(const Caller& caller,
                                          JobFilter filter) const {
  if (caller.role != Role::kAdmin) filter.tenant = caller.tenant;
  std::vector<JobSnapshot> snapshots;
  for (JobRecord& record : parts_.jobs->List(filter)) {
    snapshots.push_back(SnapshotOf(std::move(record)));
  }
  return snapshots;
}

absl::StatusOr<JobPart> JobManager::GetPart(const Caller& caller,
                                            const std::string& id,
                                            ResultPart part) const {
  ISOMATCH_ASSIGN_OR_RETURN(const JobRecord record, Find(caller, id));
  if (record.state != JobState::kSucceeded) {
    return JobHasNoResult(id, record.state);
  }
  const StoredPart* const stored = FindPart(*record.result, part);
  if (stored == nullptr) return ResultPartMissing(id, part);
  auto bytes = parts_.blobs->Get({record.tenant, stored->sha256});
  if (bytes.ok()) return JobPart{*record.result, *stored, *std::move(bytes)};
  if (!absl::IsNotFound(bytes.status())) {
    return ContentUnavailable("result", bytes.status());
  }
  // Deleted a moment ago, unless it still is there.
  ISOMATCH_RETURN_IF_ERROR(Find(caller, id).status());
  return ContentLost(id, "result");
}

JobManager::Load JobManager::load() const {
  MutexLock lock(mutex_);
  const bool can_store = gate_.is_open();
  return {queue_.size(),
          running_ - stuck_,
          stuck_,
          draining_,
          queue_.CountHeld(),
          can_store,
          can_store ? queue_.CountAwaitingRoom() : queue_.size()};
}

std::map<std::int32_t, int> JobManager::queued_by_priority() const {
  MutexLock lock(mutex_);
  return queue_.CountByPriority();
}

JobSnapshot JobManager::SnapshotOf(JobRecord record) const {
  JobSnapshot snapshot{std::move(record)};
  if (snapshot.record.state != JobState::kQueued) return snapshot;
  if (!gate_.is_open()) snapshot.waiting_for = WaitReason::kStorage;
  MutexLock lock(mutex_);
  snapshot.queue_position = queue_.JobsAhead(snapshot.record.id);
  const auto live = live_.find(snapshot.record.id);
  if (live != live_.end() && live->second->is_held) {
    snapshot.waiting_for = live->second->awaited_bytes > 0
                               ? WaitReason::kStorage
                               : WaitReason::kInputs;
  }
  return snapshot;
}

// A job's way in.

absl::StatusOr<JobManager::Place> JobManager::TakePlace(
    const Caller& caller, const std::string& request_id) {
  const auto seat = std::make_shared<Seat>(this, caller.tenant);
  {
    MutexLock lock(mutex_);
    const absl::Status taken = TakePlaceLocked(*seat);
    if (taken.ok()) return seat;
    if (request_id.empty()) return taken;
  }
  // The answer may be the job that the request has made before.
  if (parts_.jobs->FindByRequestId(caller.tenant, request_id)) return Place();
  MutexLock lock(mutex_);
  ISOMATCH_RETURN_IF_ERROR(TakePlaceLocked(*seat));  // there may be one by now
  return seat;
}

absl::Status JobManager::TakePlaceLocked(Seat& seat) {
  ISOMATCH_RETURN_IF_ERROR(CheckPlaceLocked(seat.tenant()));
  arriving_.insert(seat.tenant());
  seat.SetTaken();
  return absl::OkStatus();
}

void JobManager::GivePlaceBack(const std::string& tenant) {
  MutexLock lock(mutex_);
  arriving_.erase(arriving_.find(tenant));
}

absl::Status JobManager::CheckPlaceLocked(const std::string& tenant) const {
  if (draining_) return Draining(kRetryDraining);
  const int waiting = queue_.size() + static_cast<int>(arriving_.size());
  if (waiting >= limits_.max_queued_jobs) {
    return QueueFull(waiting, kRetryQueueFull);
  }
  const int own =
      queue_.CountOf(tenant) + static_cast<int>(arriving_.count(tenant));
  if (own >= limits_.tenant.queued_jobs) {
    return TenantQuota(tenant, own, kRetryQueueFull);
  }
  return absl::OkStatus();
}

absl::StatusOr<JobSnapshot> JobManager::Create(const Caller& caller,
                                               JobSpec spec, Place place) {
  ISOMATCH_ASSIGN_OR_RETURN(
      std::optional<JobSnapshot> before,
      FindRequest(caller, spec.request_id, spec.request_sha256));
  if (before) return *std::move(before);
  JobRecord record = NewRecord(caller, spec);
  const std::int64_t budget_bytes = parts_.budget->total_bytes();
  if (record.memory_estimate_bytes > budget_bytes) {
    return JobNeedsMoreMemoryThanBudget(record.memory_estimate_bytes,
                                        budget_bytes);
  }
  if (spec.validate_only) return JobSnapshot{std::move(record), 0};
  if (place == nullptr) {
    ISOMATCH_ASSIGN_OR_RETURN(place, TakePlace(caller, ""));
  }
  record.id = parts_.new_id();
  return Accept(caller, std::move(record), std::move(spec.inputs));
}

JobRecord JobManager::NewRecord(const Caller& caller,
                                const JobSpec& spec) const {
  JobRecord record;
  record.tenant = caller.tenant;
  record.call_id = caller.call_id;
  record.memory_estimate_bytes = parts_.runner->EstimateBytes(spec);
  record.create_time = parts_.now();
  record.labels = spec.labels;
  record.request_id = spec.request_id;
  record.request_sha256 = spec.request_sha256;
  record.priority = spec.priority;
  record.shared_priority = std::min(spec.priority, caller.max_priority);
  record.cancel_when_unwatched = spec.cancel_when_unwatched;
  record.queue_timeout = spec.queue_timeout;
  if (const auto limit = RunLimit(spec.run_timeout);
      limit < absl::InfiniteDuration()) {
    record.run_timeout = limit;
  }
  record.threads = spec.options.threads;
  for (const JobInput& input : spec.inputs) {
    record.inputs.push_back(input.sha256);
  }
  return record;
}

absl::StatusOr<JobSnapshot> JobManager::Accept(const Caller& caller,
                                               JobRecord record,
                                               std::vector<JobInput> inputs) {
  // Before others can end it, so that Move finds it guarded.
  const std::string id = record.id;
  if (record.cancel_when_unwatched) guard_.Guard(id);
  const std::string request_id = record.request_id;
  const std::string request_sha256 = record.request_sha256;
  const auto stored = Store(std::move(record), std::move(inputs));
  if (!stored.ok()) {
    guard_.Release(id);
    // The same request may have come twice at the same time.
    ISOMATCH_ASSIGN_OR_RETURN(std::optional<JobSnapshot> other,
                              FindRequest(caller, request_id, request_sha256));
    if (other) return *std::move(other);
    return stored.status();
  }
  const absl::Status queued = WithinMemory([&] {
    if (parts_.on_state) parts_.on_state(*stored);
    Enqueue(*stored);
    return absl::OkStatus();
  });
  if (!queued.ok()) FailToStart(id, queued);
  return Get(caller, id);
}

absl::StatusOr<JobRecord> JobManager::Store(JobRecord record,
                                            std::vector<JobInput> inputs) {
  ISOMATCH_RETURN_IF_ERROR(StoreInputs(record, std::move(inputs)));
  auto stored = parts_.jobs->Insert(record);
  if (stored.ok()) return stored;
  UnpinInputs(record);
  if (absl::IsAlreadyExists(stored.status())) return stored;
  return StorageFailed(stored.status());
}

absl::Status JobManager::StoreInputs(const JobRecord& record,
                                     std::vector<JobInput> inputs) {
  // What is there first, so that it does not make room for the others.
  std::stable_partition(
      inputs.begin(), inputs.end(),
      [](const JobInput& input) { return !input.bytes.has_value(); });
  JobRecord done;
  done.tenant = record.tenant;
  for (JobInput& input : inputs) {
    if (absl::Status status = StoreInput(record.tenant, input); !status.ok()) {
      UnpinInputs(done);
      return status;
    }
    done.inputs.push_back(input.sha256);
  }
  return absl::OkStatus();
}

absl::Status JobManager::StoreInput(const std::string& tenant,
                                    JobInput& input) {
  const BlobKey key = {tenant, input.sha256};
  if (!input.bytes) {
    if (parts_.blobs->Pin(key)) return absl::OkStatus();
    return MeshMissing("digest", input.sha256);  // it went since it was read
  }
  const auto size = static_cast<std::int64_t>(input.bytes->size());
  const absl::Status put = parts_.blobs->PutWithin(
      limits_.tenant.stored_bytes, key, *std::move(input.bytes), Keep::kPinned);
  if (absl::IsFailedPrecondition(put)) {
    return StorageQuota(tenant, size, limits_.tenant.stored_bytes);
  }
  return put.ok() ? put : StorageFailed(put);
}

void JobManager::Enqueue(const JobRecord& record) {
  PutInQueue(NewLive(record));
  Dispatch();
}

std::shared_ptr<LiveJob> JobManager::NewLive(const JobRecord& record) {
  const auto live = std::make_shared<LiveJob>();
  live->id = record.id;
  live->tenant = record.tenant;
  live->priority = record.priority;
  live->shared_priority = record.shared_priority;
  // Alone: with all the memory there is.
  live->memory_estimate_bytes = record.attempt < kAloneAfter
                                    ? record.memory_estimate_bytes
                                    : parts_.budget->total_bytes();
  if (const auto limit = record.queue_timeout) {
    const absl::Duration left = record.create_time + *limit - BelievedTime();
    live->timer = parts_.timers->PostAfter(
        std::clamp(left, absl::ZeroDuration(), *limit),
        [this, id = record.id, limit] {
          FailIfStill(JobState::kQueued, id, QueueTimeout(*limit));
        });
  }
  return live;
}

void JobManager::PutInQueue(const std::shared_ptr<LiveJob>& live) {
  const std::string& id = live->id;
  bool too_late = false;
  {
    MutexLock lock(mutex_);
    too_late = draining_;
    if (!too_late) PushLocked(live);
  }
  if (too_late) {
    guard_.Release(id);
    if (!limits_.durable) (void)Stop(id, JobState::kCancelled);
    return;
  }
  const std::optional<JobRecord> now = parts_.jobs->Get(id);
  if (!now || IsTerminal(now->state)) Unqueue(id);  // ended meanwhile
}

void JobManager::PushLocked(const std::shared_ptr<LiveJob>& live) {
  const auto [place, is_new] = live_.try_emplace(live->id, live);
  if (!is_new) return;  // memory ended behind this the last time
  try {
    queue_.Push(live);
  } catch (const std::bad_alloc&) {
    live_.erase(place);
    throw;
  }
}

void JobManager::ForgetOld() {
  // The next time first: memory may end.
  Executor::Timer next = parts_.timers->PostAfter(
      kRetentionInterval, [this] { OnDisk([this] { ForgetOld(); }); });
  {
    MutexLock lock(mutex_);
    if (!draining_) std::swap(retention_timer_, next);
  }
  parts_.jobs->Flush();
  Prune();
}

// Changing it.

absl::StatusOr<JobRecord> JobManager::Move(const std::string& id, JobState to,
                                           const Edit& edit) {
  ISOMATCH_ASSIGN_OR_RETURN(JobRecord moved,
                            Replace(id, [&](JobRecord& record) {
                              if (!CanMove(record.state, to))
                                return JobIsTerminal(id, record.state);
                              if (edit) ISOMATCH_RETURN_IF_ERROR(edit(record));
                              record.state = to;
                              if (IsTerminal(to)) {
                                record.end_time = parts_.now();
                                record.end_steady = Uptime();
                              }
                              if (to == JobState::kQueued) Rewind(record);
                              return absl::OkStatus();
                            }));
  OnMoved(moved);
  return moved;
}

void JobManager::OnMoved(const JobRecord& moved) {
  const bool is_over = IsTerminal(moved.state);
  if (is_over) {
    guard_.Release(moved.id);
    UnpinInputs(moved);
  }
  IfThereIsMemory([&] {  // else the log or a metric misses it
    if (parts_.on_state) parts_.on_state(moved);
  });
  WhenThereIsMemory([&] { watchers_.Notify(moved.id); });
  if (is_over) IfThereIsMemory([&] { Prune(); });  // else the next time
}

absl::StatusOr<JobRecord> JobManager::Change(const std::string& id,
                                             const Edit& edit) {
  auto changed = Replace(id, edit);
  if (changed.ok()) watchers_.Notify(id);
  return changed;
}

absl::StatusOr<JobRecord> JobManager::Replace(const std::string& id,
                                              const Edit& edit) {
  while (true) {
    std::optional<JobRecord> record = parts_.jobs->Get(id);
    if (!record) return JobNotFound(id);
    ISOMATCH_RETURN_IF_ERROR(edit(*record));
    auto changed = parts_.jobs->Update(*std::move(record));
    if (!absl::IsAborted(changed.status())) return changed;
  }
}

void JobManager::UnpinInputs(const JobRecord& record) {
  for (const std::string& sha256 : record.inputs) {
    WhenThereIsMemory([&] { parts_.blobs->Unpin({record.tenant, sha256}); });
  }
}

}  // namespace isomatch
