// The part of JobManager that runs jobs and ends them.

#include <algorithm>
#include <chrono>
#include <utility>

#include "core/base/sha256.h"
#include "core/base/status_macros.h"
#include "server/jobs/errors.h"
#include "server/jobs/job_manager.h"
#include "server/jobs/within_memory.h"

namespace isomatch {
namespace {

/// What a worker gets that is marked as stuck at the same moment.
constexpr absl::Duration kLastAnswers = absl::Seconds(1);

}  // namespace

// Running it.

void JobManager::Dispatch() {
  while (std::shared_ptr<LiveJob> live = TakeNext()) {
    const bool posted = WhenThereIsMemory(
        [&] { parts_.workers->Post([this, live] { Run(live); }); });
    if (posted) continue;
    ReleaseSlot(live);
    WhenThereIsMemory([&] { EnqueueAgain(*live, /*is_held=*/false); });
    return;  // there may be memory the next time
  }
  if (IsHeldUpByStuck()) {
    GiveUp("jobs that do not stop have memory that a waiting job needs");
  }
}

std::shared_ptr<LiveJob> JobManager::TakeNext() {
  MutexLock lock(mutex_);
  const bool may_start = !draining_ && !is_beginning_ && gate_.is_open();
  const bool has_worker =
      running_ - stuck_ < limits_.workers && running_ < threads_;
  if (!may_start || !has_worker) return nullptr;
  // What waits for memory that never comes back must not hold up the others,
  // unless a new process will have it.
  std::shared_ptr<LiveJob> live = queue_.PopFitting(
      *parts_.budget, may_give_up()
                          ? JobQueue::kAnyBytes
                          : parts_.budget->total_bytes() - stuck_bytes_);
  if (live != nullptr) ++running_;
  return live;
}

bool JobManager::IsHeldUpByStuck() const {
  MutexLock lock(mutex_);
  // While others run there is time: none is stopped for it.
  return may_give_up() && !draining_ && gate_.is_open() && stuck_ > 0 &&
         running_ == stuck_ &&
         queue_.HasLargerThan(parts_.budget->total_bytes() - stuck_bytes_);
}

void JobManager::Run(const std::shared_ptr<LiveJob>& live) {
  bool is_held = false;
  const auto record = WithinMemory([&] { return Start(*live); });
  if (record.ok()) {
    auto outcome = WithinMemory([&] { return Execute(*live, *record); });
    Finish(*live, *record, std::move(outcome));
    is_held = live->unreadable > 0 || live->awaited_bytes > 0;
  } else {
    FailToStart(live->id, record.status());
  }
  ReleaseSlot(live);
  WhenThereIsMemory([&] {
    EnqueueAgain(*live, is_held);
    Dispatch();
  });
}

absl::StatusOr<JobRecord> JobManager::Start(LiveJob& live) {
  live.timer.reset();
  runs_.Begin(live.id, ReadMemory().resident_bytes);
  if (live.stop.stop_requested()) runs_.OnAskedToStop(live.id);
  ISOMATCH_ASSIGN_OR_RETURN(
      JobRecord started,
      Move(live.id, JobState::kRunning, [&](JobRecord& record) {
        record.start_time = parts_.now();
        ++record.attempt;
        if (const auto limit = RunLimit(record.run_timeout);
            limit < absl::InfiniteDuration()) {
          record.run_timeout = limit;
        }
        return absl::OkStatus();
      }));
  runs_.SetAttempt(live.id, started.attempt);
  LimitRun(live, started);
  return started;
}

absl::Duration JobManager::RunLimit(std::optional<absl::Duration> asked) const {
  return std::min(asked.value_or(absl::InfiniteDuration()),
                  limits_.max_run_time);
}

void JobManager::LimitRun(LiveJob& live, const JobRecord& started) {
  const absl::Duration limit = RunLimit(started.run_timeout);
  if (limit == absl::InfiniteDuration()) return;
  const bool is_servers = limit == limits_.max_run_time;
  live.timer =
      parts_.timers->PostAfter(limit, [this, id = live.id, limit, is_servers] {
        FailIfStill(JobState::kRunning, id, RunTimeout(limit, is_servers));
      });
}

absl::StatusOr<RunOutcome> JobManager::Execute(const LiveJob& live,
                                               const JobRecord& record) {
  return parts_.runner->Run(
      [&] { return parts_.load_spec(record); },
      [&](const JobProgress& progress) { ReportProgress(live.id, progress); },
      live.stop.get_token());
}

void JobManager::ReportProgress(const std::string& id,
                                const JobProgress& progress) {
  runs_.OnProgress(id);
  (void)Change(id, [&](JobRecord& record) {
    if (record.state != JobState::kRunning) {
      return JobIsTerminal(id, record.state);
    }
    record.progress = progress;
    return absl::OkStatus();
  });
}

void JobManager::FailToStart(const std::string& id, const absl::Status& error) {
  WhenThereIsMemory([&] {  // however far it came
    FailIfStill(JobState::kQueued, id, error);
    FailIfStill(JobState::kRunning, id, error);
  });
}

void JobManager::Finish(LiveJob& live, const JobRecord& record,
                        absl::StatusOr<RunOutcome> outcome) {
  absl::Status status = outcome.status();
  std::int64_t bytes = 0;
  if (status.ok()) {
    for (const EncodedPart& part : outcome->parts) {
      bytes += static_cast<std::int64_t>(part.bytes.size());
    }
    status = WithinMemory([&] {
      if (!parts_.blobs->CanMakeRoom(bytes)) Prune(bytes);
      return Succeed(record, *std::move(outcome));
    });
  }
  if (status.ok()) return;
  // All are refused when it was cancelled, timed out or given up before.
  WhenThereIsMemory([&] {
    if (live.stop.stop_requested()) {
      live.awaited_bytes = 0;
      live.unreadable = 0;
      PutBack(record.id);
    } else if (!WaitForStorage(live, record, bytes, status)) {
      Fail(record, status);
    }
  });
}

void JobManager::PutBack(const std::string& id) {
  const std::optional<JobRecord> record = parts_.jobs->Get(id);
  if (!record || record->state != JobState::kRunning) return;
  const bool is_fault = HasFreedMemory(id);
  if (is_fault && record->faults + 1 >= limits_.max_faults) {
    Fail(*record, OutOfMemory("the server's memory grew beyond its limit each "
                              "time the job ran, and fell with its end"));
    return;
  }
  (void)Move(id, JobState::kQueued, [&](JobRecord& now) {
    if (is_fault) {
      ++now.faults;
    } else {
      --now.attempt;  // it had no chance
    }
    return absl::OkStatus();
  });
}

void JobManager::EnqueueAgain(const LiveJob& before, bool is_held) {
  const std::optional<JobRecord> record = parts_.jobs->Get(before.id);
  if (!record || record->state != JobState::kQueued) return;
  const std::shared_ptr<LiveJob> live = NewLive(*record);
  live->TakePlaceOf(before);
  if (is_held) Hold(live);
  PutInQueue(live);
}

absl::Status JobManager::Succeed(const JobRecord& record, RunOutcome outcome) {
  JobResult& result = outcome.result;
  const absl::Status stored = WithinMemory([&] {
    return StoreParts(record.tenant, std::move(outcome.parts), result);
  });
  if (!stored.ok()) {
    RemoveParts(record.tenant, result);
    return stored;
  }
  const absl::Status moved = WithinMemory([&] {
    return Move(record.id, JobState::kSucceeded,
                [&](JobRecord& done) {
                  done.result = result;
                  done.progress.stage_fraction = 1;
                  done.progress.total_fraction = 1;
                  return absl::OkStatus();
                })
        .status();
  });
  if (moved.ok()) return moved;
  WhenThereIsMemory([&] {
    // Memory may have ended after it had moved.
    const std::optional<JobRecord> now = parts_.jobs->Get(record.id);
    if (now && now->state == JobState::kSucceeded) return;
    RemoveParts(record.tenant, std::exchange(result, {}));
  });
  return moved;
}

absl::Status JobManager::StoreParts(const std::string& tenant,
                                    std::vector<EncodedPart> parts,
                                    JobResult& result) {
  result.parts.reserve(parts.size());  // so that no part is put and not told
  for (EncodedPart& part : parts) {
    StoredPart stored{part.part, Sha256Hex(part.bytes),
                      static_cast<std::int64_t>(part.bytes.size())};
    const absl::Status put = parts_.blobs->Put(
        {tenant, stored.sha256}, std::move(part.bytes), Keep::kPinned);
    if (!put.ok()) return StorageFailed(put);
    result.parts.push_back(std::move(stored));
  }
  return absl::OkStatus();
}

void JobManager::Fail(const JobRecord& record, const absl::Status& error) {
  const bool is_cancelled = absl::IsCancelled(error);
  (void)Move(record.id, is_cancelled ? JobState::kCancelled : JobState::kFailed,
             [&](JobRecord& now) {
               if (now.state != record.state) {
                 return absl::FailedPreconditionError("too late");
               }
               if (!is_cancelled) now.error = JobErrorOf(error);
               return absl::OkStatus();
             });
}

void JobManager::ReleaseSlot(const std::shared_ptr<LiveJob>& live) {
  live->Release();  // before the slot, so that the next job finds the memory
  MutexLock lock(mutex_);
  live_.erase(live->id);
  if (runs_.End(live->id)) {
    --stuck_;  // it has come back after all
    stuck_bytes_ -= live->memory_estimate_bytes;
  } else {
    queue_.OnEnded(live->tenant);
  }
  --running_;
  idle_.NotifyAll();
}

// Ending it early.

absl::StatusOr<JobSnapshot> JobManager::Cancel(const Caller& caller,
                                               const std::string& id) {
  ISOMATCH_RETURN_IF_ERROR(Find(caller, id).status());
  ISOMATCH_RETURN_IF_ERROR(Stop(id, JobState::kCancelled));
  return Get(caller, id);
}

absl::Status JobManager::Delete(const Caller& caller, const std::string& id) {
  ISOMATCH_ASSIGN_OR_RETURN(const JobRecord record, Find(caller, id));
  auto removed = parts_.jobs->Delete(id);
  if (absl::IsNotFound(removed.status())) return JobNotFound(id);
  if (absl::IsFailedPrecondition(removed.status())) {
    return JobIsNotTerminal(id, record.state);
  }
  if (!removed.ok()) return StorageFailed(removed.status());
  Forget({*removed});
  RemoveMeshes(*removed);
  watchers_.Notify(id);
  return absl::OkStatus();
}

absl::Status JobManager::Stop(const std::string& id, JobState to,
                              const Edit& edit) {
  ISOMATCH_RETURN_IF_ERROR(Move(id, to, edit).status());
  std::shared_ptr<LiveJob> live;
  {
    MutexLock lock(mutex_);
    const auto found = live_.find(id);
    if (found == live_.end()) return absl::OkStatus();
    live = found->second;
  }
  live->stop.request_stop();
  runs_.OnAskedToStop(id);
  if (Unqueue(id)) Dispatch();  // it may have stood in the way of others
  return absl::OkStatus();
}

std::shared_ptr<LiveJob> JobManager::Unqueue(const std::string& id) {
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

void JobManager::FailIfStill(JobState state, const std::string& id,
                             const absl::Status& error) {
  (void)Stop(id, JobState::kFailed, [&](JobRecord& record) {
    if (record.state != state) return absl::FailedPreconditionError("too late");
    record.error = JobErrorOf(error);
    return absl::OkStatus();
  });
}

void JobManager::StopRunning(const std::string& id) {
  if (!limits_.durable) {
    (void)Stop(id, JobState::kCancelled);
    return;
  }
  AskToStop(id);  // it goes back to the queue when it answers
}

void JobManager::AskToStop(const std::string& id,
                           RunningJobs::ResidentBytes resident) {
  std::shared_ptr<LiveJob> live;
  {
    MutexLock lock(mutex_);
    const auto found = live_.find(id);
    if (found == live_.end()) return;
    live = found->second;
  }
  live->stop.request_stop();
  runs_.OnAskedToStop(id, resident);
}

void JobManager::BeginDrain() {
  Executor::Timer retention;  // dropped after the lock
  {
    MutexLock lock(mutex_);
    draining_ = true;
    retention = std::move(retention_timer_);
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
    if (!limits_.durable) (void)Move(queued->id, JobState::kCancelled);
    queued->Release();
  }
}

void JobManager::Shutdown(absl::Duration drain) {
  BeginDrain();
  if (!WaitUntilIdle(drain)) {
    // One that has its worker but does not run yet hears of it when it does.
    for (const std::string& id : LiveIds()) StopRunning(id);
    if (!WaitUntilIdle(limits_.unresponsive_grace)) {
      for (const std::string& id : runs_.Ids()) OnNoAnswer(id);
      WaitUntilIdle(kLastAnswers);
    }
  }
  guard_.ReleaseAll();
  parts_.jobs->Flush();
  stopped_ = true;
  Executor::Timer watch;  // dropped after the lock
  {
    MutexLock lock(mutex_);
    watch = std::move(watch_timer_);
  }
  watchers_.NotifyAll();
}

bool JobManager::WaitUntilIdle(absl::Duration timeout) {
  const auto deadline =
      std::chrono::steady_clock::now() +
      absl::ToChronoMilliseconds(std::min(timeout, absl::Hours(24 * 365)));
  MutexLock lock(mutex_);
  while (!is_idle()) {
    if (!idle_.WaitUntil(mutex_, deadline)) return is_idle();
  }
  return true;
}

std::vector<std::string> JobManager::LiveIds() const {
  std::vector<std::string> ids;
  MutexLock lock(mutex_);
  for (const auto& [id, live] : live_) ids.push_back(id);
  return ids;
}

}  // namespace isomatch
