#include "server/jobs/job_watchdog.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/jobs/errors.h"
#include "server/jobs/within_memory.h"

namespace isomatch {
namespace {

constexpr absl::Duration kWatchInterval = absl::Milliseconds(200);

/// How long a job that was asked to stop for its memory may take: memory that
/// grows without end leaves no more time.
constexpr absl::Duration kMemoryGrace = absl::Seconds(2);

/// A job that told of its progress within this time is not the one that grows,
/// unless it is the only one.
constexpr absl::Duration kSilence = absl::Seconds(1);

}  // namespace

void JobWatchdog::Watch() {
  {
    const absl::Duration now = environment_.uptime();
    MutexLock lock(mutex_);
    looked_ = now;
  }
  for (const auto& id :
       scheduler_.runs().Unanswered(environment_.limits.unresponsive_grace)) {
    OnNoAnswer(id);
  }
  const MemoryFigures memory = ReadSettledMemory();
  WatchMemory(memory);
  WriteTrace(memory);
  // Else ClusterMember does, which may wait for the store.
  if (environment_.shared == nullptr) scheduler_.Dispatch();
  Executor::Timer next =
      environment_.watch->PostAfter(kWatchInterval, [this] { Watch(); });
  MutexLock lock(mutex_);
  if (!is_stopped_) timer_ = std::move(next);
}

void JobWatchdog::Stop() {
  Executor::Timer timer;  // dropped after the lock
  MutexLock lock(mutex_);
  is_stopped_ = true;
  timer = std::move(timer_);
}

absl::Duration JobWatchdog::SinceLooked() const {
  const absl::Duration now = environment_.uptime();
  MutexLock lock(mutex_);
  return now - looked_;
}

MemoryFigures JobWatchdog::ReadSettledMemory() {
  MemoryFigures memory = environment_.read_memory();
  const std::int64_t expected = memory.expected_bytes;
  memory.expected_bytes += idle_excess_bytes_;
  if (memory.resident_bytes <=
      std::min(memory.expected_bytes, memory.limit_bytes)) {
    settled_bytes_ = 0;
  } else if (memory.resident_bytes > settled_bytes_ + settled_bytes_ / 10) {
    environment_.release_memory();
    settled_bytes_ = memory.resident_bytes =
        environment_.read_memory().resident_bytes;
  }
  if (scheduler_.runs().IsEmpty()) {
    idle_excess_bytes_ =
        std::max<std::int64_t>(0, memory.resident_bytes - expected);
  }
  return memory;
}

void JobWatchdog::WriteTrace(const MemoryFigures& memory) {
  if (environment_.traces == nullptr) return;
  std::vector<JobTrace> jobs = scheduler_.runs().Traces();
  if (jobs.empty() && is_trace_empty_) return;
  is_trace_empty_ = jobs.empty();
  environment_.traces->Write(
      {memory.resident_bytes, memory.expected_bytes, std::move(jobs)});
}

void JobWatchdog::WatchMemory(const MemoryFigures& memory) {
  if (memory.resident_bytes <= memory.limit_bytes) tolerated_bytes_ = 0;
  if (memory.resident_bytes <=
      std::max<std::int64_t>(memory.limit_bytes, tolerated_bytes_)) {
    return;
  }
  const std::vector<JobTrace> traces = scheduler_.runs().Traces();
  if (traces.empty()) return;  // no job's doing
  const JobTrace& asked = *std::max_element(
      traces.begin(), traces.end(), [](const auto& a, const auto& b) {
        return a.unanswered < b.unanswered;  // those that were not are least
      });
  if (asked.unanswered) {
    if (*asked.unanswered < kMemoryGrace) return;  // it may answer yet
    OnNoAnswer(asked.id);
    return scheduler_.GiveUp(
        absl::StrCat("the process has ", memory.resident_bytes >> 20,
                     " MiB, its limit is ", memory.limit_bytes >> 20,
                     " MiB, and job ", asked.id, " does not stop"));
  }
  const JobTrace& silent = *std::max_element(
      traces.begin(), traces.end(),
      [](const auto& a, const auto& b) { return a.silent < b.silent; });
  if (traces.size() > 1 && silent.silent < kSilence) return;
  scheduler_.AskToStop(silent.id, memory.resident_bytes);
}

bool JobWatchdog::HasFreedMemory(const std::string& id) {
  const auto before = scheduler_.runs().ResidentWhenAsked(id);
  if (!before) return false;
  environment_.release_memory();
  const std::int64_t now = environment_.read_memory().resident_bytes;
  const bool has_freed = now < *before - *before / 10;
  if (!has_freed) tolerated_bytes_ = now + now / 10;
  return has_freed;
}

void JobWatchdog::OnNoAnswer(const std::string& id) {
  if (!scheduler_.SetStuck(id)) return;
  WhenThereIsMemory([&] {
    const auto record = RecordNoAnswer(id);
    IfThereIsMemory([&] {
      if (record.ok()) environment_.on_stuck(*record);
    });
  });
  scheduler_.ReplaceWorker();
}

absl::StatusOr<JobRecord> JobWatchdog::RecordNoAnswer(const std::string& id) {
  const JobLimits& limits = environment_.limits;
  const bool is_last = scheduler_.local_load().draining;
  const bool has_next =
      environment_.shared != nullptr ||
      (limits.durable && (is_last || environment_.on_give_up));
  const std::uint64_t claim = scheduler_.runs().ClaimOf(id);
  ISOMATCH_ASSIGN_OR_RETURN(const JobRecord record, lifecycle_.Read(id));
  const int faults = record.faults + 1;
  const auto mark = [&](JobRecord& now) {
    now.unresponsive = true;
    now.faults = faults;
  };
  if (record.state == JobState::kRunning) {
    const bool runs_again = has_next && faults < limits.max_faults;
    auto moved =
        lifecycle_.Move(id, runs_again ? JobState::kQueued : JobState::kFailed,
                        [&](JobRecord& now) {
                          if (now.claim != claim) {
                            return absl::FailedPreconditionError("too late");
                          }
                          mark(now);
                          if (!runs_again)
                            now.error = JobErrorOf(Unresponsive(faults));
                          return absl::OkStatus();
                        });
    if (moved.ok()) return moved;  // else it was ended meanwhile
  }
  return lifecycle_.Change(id, [&](JobRecord& now) {
    mark(now);
    return absl::OkStatus();
  });
}

}  // namespace isomatch
