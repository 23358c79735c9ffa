#include "server/jobs/job_scheduler.h"

#include <algorithm>
#include <chrono>
#include <new>
#include <optional>
#include <utility>

#include "absl/cleanup/cleanup.h"
#include "core/base/status_macros.h"
#include "server/jobs/errors.h"
#include "server/jobs/within_memory.h"

namespace isomatch {
namespace {

// How long a job whose inputs could not be read waits: twice as long each time.
constexpr absl::Duration kFirstHold = absl::Seconds(1);
constexpr absl::Duration kLongestHold = absl::Seconds(30);

/// Between attempts to write to a store that is asked all the time anyway.
constexpr absl::Duration kLongestPauseOfShared = absl::Seconds(2);

}  // namespace

absl::Duration HoldAfter(int times_held) {
  absl::Duration hold = kFirstHold;
  for (int i = 0; i < times_held && hold < kLongestHold; ++i) hold *= 2;
  return std::min(hold, kLongestHold);
}

JobScheduler::JobScheduler(
    const JobEnvironment& environment, JobLifecycle* lifecycle, DiskWork* disk,
    std::function<void(const std::shared_ptr<LiveJob>&)> run)
    : environment_(environment),
      lifecycle_(*lifecycle),
      disk_(*disk),
      run_(std::move(run)),
      gate_(MakeGateEnvironment()),
      runs_(environment.uptime),
      shared_queue_(environment),
      queue_(environment.limits.max_passes,
             environment.limits.tenant.running_jobs),
      threads_(environment.limits.workers) {}

StorageGate::Environment JobScheduler::MakeGateEnvironment() {
  return {
      .timers = environment_.timers,
      .on_disk =
          [this](std::function<void()> work) { disk_.Run(std::move(work)); },
      .probe = [this] { return environment_.blobs->TryWriting(0); },
      .on_change =
          [this](const absl::Status& storage) {
            // Else the log misses it.
            IfThereIsMemory([&] { environment_.on_storage(storage); });
            if (storage.ok()) Dispatch();
          },
      .longest_pause =
          is_shared() ? kLongestPauseOfShared : StorageGate::kLongestPause};
}

// Asking.

JobLoad JobScheduler::load() const {
  JobLoad load = local_load();
  if (is_shared()) load.queued_jobs = shared_queue_.Counts().queued;
  return load;
}

JobLoad JobScheduler::local_load() const {
  const bool can_store = gate_.is_open();
  MutexLock lock(mutex_);
  return {queue_.size(),
          running_ - stuck_,
          stuck_,
          draining_,
          queue_.CountHeld(),
          can_store,
          can_store ? queue_.CountAwaitingRoom() : queue_.size()};
}

std::map<std::int32_t, int> JobScheduler::queued_by_priority() const {
  MutexLock lock(mutex_);
  return queue_.CountByPriority();
}

QueueRoom JobScheduler::RoomFor(const std::string& tenant) const {
  MutexLock lock(mutex_);
  return {draining_, queue_.size(), queue_.CountOf(tenant)};
}

absl::StatusOr<QueueRoom> JobScheduler::SharedRoomFor(
    const std::string& tenant) {
  auto of_tenant = shared_queue_.CountQueuedOf(tenant);
  if (!of_tenant.ok()) return StorageSilent(of_tenant.status());
  const int queued = shared_queue_.Counts().queued;
  MutexLock lock(mutex_);
  return QueueRoom{draining_, queued, *of_tenant};
}

WorkerFigures JobScheduler::Workers() const {
  const WorkerFigures own = {.slots = environment_.limits.workers,
                             .threads = environment_.threads_per_job,
                             .job_bytes = environment_.budget->total_bytes()};
  if (!is_shared()) return own;
  const WorkerFigures all = shared_queue_.Workers();
  if (all.slots > 0) return all;
  return {.slots = own.slots, .threads = own.threads, .job_bytes = 0};
}

JobSnapshot JobScheduler::SnapshotOf(JobRecord record) const {
  JobSnapshot snapshot{std::move(record)};
  if (snapshot.record.state != JobState::kQueued) return snapshot;
  if (is_shared()) {
    snapshot.queue_position = shared_queue_.PositionOf(snapshot.record.id);
    if (snapshot.record.is_held) {
      snapshot.waiting_for = snapshot.record.unreadable > 0
                                 ? WaitReason::kInputs
                                 : WaitReason::kStorage;
    }
    return snapshot;
  }
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

std::vector<std::string> JobScheduler::LiveIds() const {
  std::vector<std::string> ids;
  MutexLock lock(mutex_);
  for (const auto& [id, live] : live_) ids.push_back(id);
  return ids;
}

std::shared_ptr<LiveJob> JobScheduler::FindLive(const std::string& id) const {
  MutexLock lock(mutex_);
  const auto found = live_.find(id);
  return found == live_.end() ? nullptr : found->second;
}

// Starting.

void JobScheduler::Begin() {
  MutexLock lock(mutex_);
  is_beginning_ = true;
}

void JobScheduler::EndBegin() {
  {
    MutexLock lock(mutex_);
    is_beginning_ = false;
  }
  Dispatch();
}

void JobScheduler::Enqueue(const JobRecord& record,
                           std::unique_ptr<JobSpec> spec) {
  if (is_shared()) return Dispatch();
  const std::shared_ptr<LiveJob> live = NewLive(record);
  live->spec = std::move(spec);
  // Of jobs that wait nobody counts the memory.
  const absl::Cleanup drop_if_it_waits = [&] {
    std::unique_ptr<JobSpec> dropped;
    MutexLock lock(mutex_);
    if (queue_.Has(live->id)) dropped = std::move(live->spec);
  };
  PutInQueue(live);
  Dispatch();
}

std::shared_ptr<LiveJob> JobScheduler::NewLive(const JobRecord& record) {
  auto live = std::make_shared<LiveJob>();
  live->id = record.id;
  live->tenant = record.tenant;
  live->priority = record.priority;
  live->shared_priority = record.shared_priority;
  // Alone: with all the memory there is.
  live->memory_estimate_bytes = record.attempt < kAloneAfter
                                    ? record.memory_estimate_bytes
                                    : environment_.budget->total_bytes();
  if (const auto limit = record.queue_timeout) {
    const absl::Duration left =
        record.create_time + *limit - environment_.BelievedTime();
    live->timer = environment_.timers->PostAfter(
        std::clamp(left, absl::ZeroDuration(), *limit),
        [this, id = record.id, limit] {
          FailIfStill(JobState::kQueued, id, QueueTimeout(*limit));
        });
  }
  return live;
}

void JobScheduler::PutInQueue(const std::shared_ptr<LiveJob>& live) {
  const std::string& id = live->id;
  bool too_late = false;
  {
    MutexLock lock(mutex_);
    too_late = draining_;
    if (!too_late) PushLocked(live);
  }
  if (too_late) {
    lifecycle_.guard().Release(id);
    if (!environment_.limits.durable) (void)Stop(id, JobState::kCancelled);
    return;
  }
  const auto now = lifecycle_.Read(id);
  if (!now.ok() || IsTerminal(now->state)) Unqueue(id);  // ended meanwhile
}

void JobScheduler::PushLocked(const std::shared_ptr<LiveJob>& live) {
  const auto [place, is_new] = live_.try_emplace(live->id, live);
  if (!is_new) return;  // memory ended behind this the last time
  try {
    queue_.Push(live);
  } catch (const std::bad_alloc&) {
    live_.erase(place);
    throw;
  }
}

void JobScheduler::EnqueueAgain(const LiveJob& before) {
  if (is_shared()) return;  // whoever put it back has said all
  const auto record = lifecycle_.Read(before.id);
  if (!record.ok() || record->state != JobState::kQueued) return;
  const std::shared_ptr<LiveJob> live = NewLive(*record);
  live->TakePlaceOf(before);
  if (live->unreadable > 0 || live->awaited_bytes > 0) Hold(live);
  PutInQueue(live);
}

void JobScheduler::Dispatch() {
  while (std::shared_ptr<LiveJob> live = TakeNext()) {
    const bool posted = WhenThereIsMemory(
        [&] { environment_.workers->Post([this, live] { run_(live); }); });
    if (posted) continue;
    Release(live);
    WhenThereIsMemory([&] { EnqueueAgain(*live); });
    return;  // there may be memory the next time
  }
  if (IsHeldUpByStuck()) {
    GiveUp("jobs that do not stop have memory that a waiting job needs");
  }
}

std::shared_ptr<LiveJob> JobScheduler::TakeNext() {
  if (is_shared()) return ClaimNext();
  MutexLock lock(mutex_);
  const bool may_start = !draining_ && !is_beginning_ && gate_.is_open();
  if (!may_start || !has_free_worker()) return nullptr;
  // What waits for memory that never comes back must not hold up the others,
  // unless a new process will have it.
  MemoryBudget& budget = *environment_.budget;
  std::shared_ptr<LiveJob> live = queue_.PopFitting(
      budget, environment_.may_give_up() ? JobQueue::kAnyBytes
                                         : budget.total_bytes() - stuck_bytes_);
  if (live != nullptr) ++running_;
  return live;
}

void JobScheduler::LetClaim(bool may_claim) {
  MutexLock lock(mutex_);
  may_claim_ = may_claim;
}

std::shared_ptr<LiveJob> JobScheduler::ClaimNext() {
  {
    MutexLock lock(mutex_);
    if (draining_ || !may_claim_ || !gate_.is_open() || !has_free_worker()) {
      return nullptr;
    }
    ++running_;  // a place for it
  }
  absl::Cleanup give_place_back = [this] {
    MutexLock lock(mutex_);
    --running_;
    idle_.NotifyAll();
  };
  std::shared_ptr<LiveJob> live = shared_queue_.Claim();
  if (live == nullptr) return nullptr;
  MutexLock lock(mutex_);  // given back before the place is
  live_[live->id] = live;
  std::move(give_place_back).Cancel();
  if (draining_) live->stop.request_stop();  // it goes back at once
  return live;
}

bool JobScheduler::IsHeldUpByStuck() const {
  MutexLock lock(mutex_);
  // While others run there is time: none is stopped for it.
  return environment_.may_give_up() && !draining_ && gate_.is_open() &&
         stuck_ > 0 && running_ == stuck_ &&
         queue_.HasLargerThan(environment_.budget->total_bytes() -
                              stuck_bytes_);
}

void JobScheduler::Release(const std::shared_ptr<LiveJob>& live) {
  live->Release();  // before the slot, so that the next job finds the memory
  MutexLock lock(mutex_);
  live_.erase(live->id);
  if (runs_.End(live->id)) {
    --stuck_;  // it has come back after all
    stuck_bytes_ -= live->memory_estimate_bytes;
  } else if (!is_shared()) {
    queue_.OnEnded(live->tenant);
  }
  --running_;
  idle_.NotifyAll();
}

// Held jobs.

void JobScheduler::Hold(const std::shared_ptr<LiveJob>& live) {
  live->is_held = true;
  live->timer = HoldTimer(live, live->times_held++);
}

Executor::Timer JobScheduler::HoldTimer(const std::shared_ptr<LiveJob>& live,
                                        int times_held) {
  return environment_.timers->PostAfter(
      HoldAfter(times_held),
      [this, weak = std::weak_ptr<LiveJob>(live)] { LetStart(weak); });
}

bool JobScheduler::IsHeldLocked(const std::shared_ptr<LiveJob>& live) const {
  const auto found = live_.find(live->id);
  return found != live_.end() && found->second == live && live->is_held;
}

void JobScheduler::LetStart(const std::weak_ptr<LiveJob>& weak) {
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
  disk_.Run([this, weak, bytes] {
    const std::shared_ptr<LiveJob> waiting = weak.lock();
    if (waiting == nullptr || !environment_.blobs->TryWriting(bytes).ok()) {
      return;
    }
    EndHold(*waiting);
  });
}

void JobScheduler::EndHold(LiveJob& live) {
  {
    MutexLock lock(mutex_);
    queue_.EndHold(live);
    live.awaited_bytes = 0;
  }
  Dispatch();
}

// Ending early.

absl::Status JobScheduler::Stop(const std::string& id, JobState to,
                                const Edit& edit) {
  ISOMATCH_RETURN_IF_ERROR(lifecycle_.Move(id, to, edit).status());
  AskToStop(id);
  if (Unqueue(id)) Dispatch();  // it may have stood in the way of others
  return absl::OkStatus();
}

void JobScheduler::FailIfStill(JobState state, const std::string& id,
                               const absl::Status& error) {
  const std::uint64_t claim = runs_.ClaimOf(id);
  (void)Stop(id, JobState::kFailed, [&](JobRecord& record) {
    const bool is_own = record.claim == claim || state == JobState::kQueued;
    if (record.state != state || !is_own) {
      return absl::FailedPreconditionError("too late");
    }
    record.error = JobErrorOf(error);
    return absl::OkStatus();
  });
}

void JobScheduler::AskToStop(const std::string& id,
                             RunningJobs::ResidentBytes resident) {
  const std::shared_ptr<LiveJob> live = FindLive(id);
  if (live == nullptr) return;
  live->stop.request_stop();
  runs_.OnAskedToStop(id, resident);
}

std::shared_ptr<LiveJob> JobScheduler::Unqueue(const std::string& id) {
  std::shared_ptr<LiveJob> queued;
  {
    MutexLock lock(mutex_);
    queued = queue_.Remove(id);
    if (queued == nullptr) return nullptr;
    live_.erase(id);
  }
  queued->Release();
  return queued;
}

// Workers that do not come back.

bool JobScheduler::SetStuck(const std::string& id) {
  MutexLock lock(mutex_);
  const auto live = live_.find(id);
  if (live == live_.end() || !runs_.SetStuck(id)) return false;
  ++stuck_;
  ++unrecorded_;
  stuck_bytes_ += live->second->memory_estimate_bytes;
  // Its other jobs need not wait for it.
  if (!is_shared()) queue_.OnEnded(live->second->tenant);
  return true;
}

void JobScheduler::ReplaceWorker() {
  const int workers = environment_.limits.workers;
  bool needs_thread = false;
  bool are_all_stuck = false;
  {
    MutexLock lock(mutex_);
    --unrecorded_;
    idle_.NotifyAll();
    if (draining_) return;
    are_all_stuck = environment_.may_give_up() && stuck_ >= workers;
    needs_thread = !are_all_stuck && threads_ < workers + stuck_;
  }
  if (are_all_stuck) {
    return GiveUp("jobs that do not stop have taken all workers");
  }
  if (needs_thread && environment_.workers->AddThread()) {
    MutexLock lock(mutex_);
    ++threads_;
  } else if (needs_thread && environment_.may_give_up()) {
    return GiveUp("the system has no thread for one that a job has taken");
  }
  Dispatch();
}

void JobScheduler::GiveUp(const std::string& reason) {
  {
    MutexLock lock(mutex_);
    if (draining_ || has_given_up_) return;
    has_given_up_ = true;
  }
  if (environment_.on_give_up) environment_.on_give_up(reason);
}

// The end.

void JobScheduler::BeginDrain() {
  {
    MutexLock lock(mutex_);
    draining_ = true;
  }
  gate_.Stop();
  while (true) {
    std::shared_ptr<LiveJob> queued;
    {
      MutexLock lock(mutex_);
      queued = queue_.PopAny();
      if (queued != nullptr) live_.erase(queued->id);
    }
    if (queued == nullptr) return;
    if (!environment_.limits.durable) {
      (void)lifecycle_.Move(queued->id, JobState::kCancelled);
    }
    queued->Release();
  }
}

bool JobScheduler::WaitUntilIdle(absl::Duration timeout) {
  const auto deadline =
      std::chrono::steady_clock::now() +
      absl::ToChronoMilliseconds(std::min(timeout, absl::Hours(24 * 365)));
  MutexLock lock(mutex_);
  while (!is_idle()) {
    if (!idle_.WaitUntil(mutex_, deadline)) return is_idle();
  }
  return true;
}

}  // namespace isomatch
