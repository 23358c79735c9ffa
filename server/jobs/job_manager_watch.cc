// The part of JobManager that watches over jobs that run.

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "server/jobs/errors.h"
#include "server/jobs/job_manager.h"
#include "server/jobs/within_memory.h"

namespace isomatch {
namespace {

constexpr absl::Duration kWatchInterval = absl::Milliseconds(200);

/// Where memory grows without end there is no time for more.
constexpr absl::Duration kMemoryGrace = absl::Seconds(2);

/// A job that told of its progress within this time is not the one that grows,
/// unless it is the only one.
constexpr absl::Duration kSilence = absl::Seconds(1);

}  // namespace

void JobManager::Watch() {
  for (const auto& id : runs_.Unanswered(limits_.unresponsive_grace)) {
    OnNoAnswer(id);
  }
  const MemoryFigures memory = ReadSettledMemory();
  WatchMemory(memory);
  WriteTrace(memory);
  Executor::Timer next =
      parts_.watch->PostAfter(kWatchInterval, [this] { Watch(); });
  MutexLock lock(mutex_);
  if (!stopped_) watch_timer_ = std::move(next);
}

JobManager::MemoryFigures JobManager::ReadMemory() const {
  return parts_.read_memory ? parts_.read_memory() : MemoryFigures();
}

JobManager::MemoryFigures JobManager::ReadSettledMemory() {
  MemoryFigures memory = ReadMemory();
  const std::int64_t expected = memory.expected_bytes;
  memory.expected_bytes += idle_excess_bytes_;
  if (memory.resident_bytes <=
      std::min(memory.expected_bytes, memory.limit_bytes)) {
    settled_bytes_ = 0;
  } else if (memory.resident_bytes > settled_bytes_ + settled_bytes_ / 10) {
    parts_.release_memory();
    settled_bytes_ = memory.resident_bytes = ReadMemory().resident_bytes;
  }
  if (runs_.IsEmpty()) {
    idle_excess_bytes_ =
        std::max<std::int64_t>(0, memory.resident_bytes - expected);
  }
  return memory;
}

void JobManager::WriteTrace(const MemoryFigures& memory) {
  if (parts_.traces == nullptr) return;
  std::vector<JobTrace> jobs = runs_.Traces();
  if (jobs.empty() && is_trace_empty_) return;
  is_trace_empty_ = jobs.empty();
  parts_.traces->Write(
      {memory.resident_bytes, memory.expected_bytes, std::move(jobs)});
}

void JobManager::WatchMemory(const MemoryFigures& memory) {
  if (memory.resident_bytes <= memory.limit_bytes) tolerated_bytes_ = 0;
  if (memory.resident_bytes <=
      std::max<std::int64_t>(memory.limit_bytes, tolerated_bytes_)) {
    return;
  }
  const std::vector<JobTrace> traces = runs_.Traces();
  if (traces.empty()) return;  // no job's doing
  const JobTrace& asked = *std::max_element(
      traces.begin(), traces.end(), [](const auto& a, const auto& b) {
        return a.unanswered < b.unanswered;  // those that were not are least
      });
  if (asked.unanswered) {
    if (*asked.unanswered < kMemoryGrace) return;  // it may answer yet
    OnNoAnswer(asked.id);
    return GiveUp(absl::StrCat("the process has ", memory.resident_bytes >> 20,
                               " MiB, its limit is ", memory.limit_bytes >> 20,
                               " MiB, and job ", asked.id, " does not stop"));
  }
  const JobTrace& silent = *std::max_element(
      traces.begin(), traces.end(),
      [](const auto& a, const auto& b) { return a.silent < b.silent; });
  if (traces.size() > 1 && silent.silent < kSilence) return;
  AskToStop(silent.id, memory.resident_bytes);
}

bool JobManager::HasFreedMemory(const std::string& id) {
  const auto before = runs_.ResidentWhenAsked(id);
  if (!before) return false;
  parts_.release_memory();
  const std::int64_t now = ReadMemory().resident_bytes;
  const bool has_freed = now < *before - *before / 10;
  if (!has_freed) tolerated_bytes_ = now + now / 10;
  return has_freed;
}

void JobManager::OnNoAnswer(const std::string& id) {
  if (!SetStuck(id)) return;
  WhenThereIsMemory([&] {
    const auto record = RecordNoAnswer(id);
    IfThereIsMemory([&] {
      if (record.ok() && parts_.on_stuck) parts_.on_stuck(*record);
    });
  });
  ReplaceWorker();
}

bool JobManager::SetStuck(const std::string& id) {
  MutexLock lock(mutex_);
  const auto live = live_.find(id);
  if (live == live_.end() || !runs_.SetStuck(id)) return false;
  ++stuck_;
  ++unrecorded_;
  stuck_bytes_ += live->second->memory_estimate_bytes;
  queue_.OnEnded(live->second->tenant);  // its other jobs need not wait for it
  return true;
}

absl::StatusOr<JobRecord> JobManager::RecordNoAnswer(const std::string& id) {
  const bool is_last = load().draining;
  const bool has_next =
      limits_.durable && (is_last || parts_.on_give_up != nullptr);
  const std::optional<JobRecord> record = parts_.jobs->Get(id);
  if (!record) return JobNotFound(id);
  const int faults = record->faults + 1;
  const auto mark = [&](JobRecord& now) {
    now.unresponsive = true;
    now.faults = faults;
  };
  if (record->state == JobState::kRunning) {
    const bool runs_again = has_next && faults < limits_.max_faults;
    auto moved = Move(id, runs_again ? JobState::kQueued : JobState::kFailed,
                      [&](JobRecord& now) {
                        mark(now);
                        if (!runs_again)
                          now.error = JobErrorOf(Unresponsive(faults));
                        return absl::OkStatus();
                      });
    if (moved.ok()) return moved;  // else it was ended meanwhile
  }
  return Change(id, [&](JobRecord& now) {
    mark(now);
    return absl::OkStatus();
  });
}

void JobManager::ReplaceWorker() {
  bool needs_thread = false;
  bool are_all_stuck = false;
  {
    MutexLock lock(mutex_);
    --unrecorded_;
    idle_.NotifyAll();
    if (draining_) return;
    are_all_stuck = may_give_up() && stuck_ >= limits_.workers;
    needs_thread = !are_all_stuck && threads_ < limits_.workers + stuck_;
  }
  if (are_all_stuck) {
    return GiveUp("jobs that do not stop have taken all workers");
  }
  if (needs_thread && parts_.workers->AddThread()) {
    MutexLock lock(mutex_);
    ++threads_;
  } else if (needs_thread && may_give_up()) {
    return GiveUp("the system has no thread for one that a job has taken");
  }
  WhenThereIsMemory([&] { Dispatch(); });
}

void JobManager::GiveUp(const std::string& reason) {
  {
    MutexLock lock(mutex_);
    if (draining_ || has_given_up_) return;
    has_given_up_ = true;
  }
  if (parts_.on_give_up) parts_.on_give_up(reason);
}

}  // namespace isomatch
