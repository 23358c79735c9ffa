#include "server/jobs/job_execution.h"

#include <utility>

#include "absl/time/clock.h"
#include "core/base/sha256.h"
#include "core/base/status_macros.h"
#include "server/jobs/errors.h"
#include "server/jobs/within_memory.h"

namespace isomatch {
namespace {

/// How often in a row the inputs may be unreadable: for an hour.
constexpr int kMostUnreadable = 124;

/// How long a result waits in memory for a store that does not answer, and how
/// often it is tried.
constexpr absl::Duration kLongestSilence = absl::Minutes(15);
constexpr absl::Duration kSilencePause = absl::Milliseconds(500);

/// The job may be another process's by now, or this one's by a later claim.
absl::Status CheckOwn(const JobRecord& started, const JobRecord& now) {
  if (now.claim == started.claim) return absl::OkStatus();
  return absl::FailedPreconditionError("another worker has the job");
}

}  // namespace

void JobExecution::Run(const std::shared_ptr<LiveJob>& live) {
  // Here a worker's thread begins: wherever memory ends behind it, the job
  // fails and its slot comes back.
  Progress progress;
  const absl::Status ended =
      WithinMemory([&] { return RunToEnd(*live, progress); });
  if (!ended.ok()) {
    WhenThereIsMemory([&] { Settle(*live, progress, ended); });
  }
  scheduler_.Release(live);
  WhenThereIsMemory([&] {
    scheduler_.EnqueueAgain(*live);
    scheduler_.Dispatch();
  });
}

absl::Status JobExecution::RunToEnd(LiveJob& live, Progress& progress) {
  ISOMATCH_ASSIGN_OR_RETURN(progress.started, Start(live));
  const JobRecord& record = *progress.started;
  const auto take_spec = [&]() -> absl::StatusOr<JobSpec> {
    const std::unique_ptr<JobSpec> created = std::move(live.spec);
    return created != nullptr ? std::move(*created)
                              : environment_.load_spec(record);
  };
  ISOMATCH_ASSIGN_OR_RETURN(
      RunOutcome outcome,
      environment_.runner->Run(
          take_spec,
          [&](const JobProgress& now) { ReportProgress(live.id, now); },
          {live.stop.get_token(), live.hurry.get_token()}));
  return WhenStoreAnswers(
      live, [&] { return StoreResult(record, outcome, progress); });
}

absl::Status JobExecution::StoreResult(const JobRecord& started,
                                       const RunOutcome& outcome,
                                       Progress& progress) {
  ISOMATCH_RETURN_IF_ERROR(StoreParts(started.tenant, outcome.parts, progress));
  JobResult result = outcome.result;
  result.parts = progress.stored;
  const auto moved =
      lifecycle_.Move(started.id, JobState::kSucceeded, [&](JobRecord& done) {
        ISOMATCH_RETURN_IF_ERROR(CheckOwn(started, done));
        done.result = result;
        done.progress.stage_fraction = 1;
        done.progress.total_fraction = 1;
        return absl::OkStatus();
      });
  return moved.status();
}

absl::Status JobExecution::WhenStoreAnswers(
    const LiveJob& live, const std::function<absl::Status()>& store) const {
  const absl::Duration end = environment_.uptime() + kLongestSilence;
  while (true) {
    absl::Status stored = store();
    const bool may_pass = environment_.shared != nullptr &&
                          absl::IsUnavailable(stored) &&
                          !live.stop.stop_requested();
    if (!may_pass || environment_.uptime() > end) return stored;
    absl::SleepFor(kSilencePause);
  }
}

absl::StatusOr<JobRecord> JobExecution::Start(LiveJob& live) {
  RunningJobs& runs = scheduler_.runs();
  live.timer.reset();
  runs.Begin(live.id, environment_.read_memory().resident_bytes);
  if (live.stop.stop_requested()) runs.OnAskedToStop(live.id);
  if (live.claimed) {
    runs.SetClaim(live.id, live.claimed->claim);
    lifecycle_.OnClaimed(*live.claimed);
  }
  ISOMATCH_ASSIGN_OR_RETURN(
      JobRecord started, live.claimed ? *live.claimed : MoveToRunning(live.id));
  runs.SetAttempt(live.id, started.attempt);
  LimitRunTime(live, started);
  if (started.deadline) {
    live.deadline_timer = environment_.timers->PostAfter(
        *started.deadline,
        [hurry = live.hurry]() mutable { hurry.request_stop(); });
  }
  return started;
}

absl::StatusOr<JobRecord> JobExecution::MoveToRunning(const std::string& id) {
  return lifecycle_.Move(id, JobState::kRunning, [&](JobRecord& record) {
    record.start_time = environment_.now();
    ++record.attempt;
    if (const auto limit = environment_.limits.RunTime(record.run_timeout);
        limit < absl::InfiniteDuration()) {
      record.run_timeout = limit;
    }
    return absl::OkStatus();
  });
}

void JobExecution::LimitRunTime(LiveJob& live, const JobRecord& started) {
  const absl::Duration limit = environment_.limits.RunTime(started.run_timeout);
  if (limit == absl::InfiniteDuration()) return;
  const bool is_servers = limit == environment_.limits.max_run_time;
  live.timer = environment_.timers->PostAfter(
      limit, [this, id = live.id, limit, is_servers] {
        scheduler_.FailIfStill(JobState::kRunning, id,
                               RunTimeout(limit, is_servers));
      });
}

void JobExecution::ReportProgress(const std::string& id,
                                  const JobProgress& progress) {
  scheduler_.runs().OnProgress(id, progress);
  if (environment_.shared != nullptr) return;  // ClusterMember tells it
  (void)lifecycle_.Change(id, [&](JobRecord& record) {
    if (record.state != JobState::kRunning) {
      return JobIsTerminal(id, record.state);
    }
    record.progress = progress;
    return absl::OkStatus();
  });
}

absl::Status JobExecution::StoreParts(const std::string& tenant,
                                      const std::vector<EncodedPart>& parts,
                                      Progress& progress) {
  progress.result_bytes = 0;
  progress.stored.clear();
  for (const EncodedPart& part : parts) {
    progress.result_bytes += static_cast<std::int64_t>(part.bytes.size());
  }
  if (!environment_.blobs->CanMakeRoom(progress.result_bytes)) {
    retention_.Prune(progress.result_bytes);
  }
  progress.stored.reserve(parts.size());  // so that none is put and not told
  for (const EncodedPart& part : parts) {
    StoredPart stored{part.part, Sha256Hex(part.bytes),
                      static_cast<std::int64_t>(part.bytes.size())};
    const absl::Status put = environment_.blobs->Put({tenant, stored.sha256},
                                                     part.bytes, Keep::kPinned);
    if (!put.ok()) return StorageFailed(put);
    progress.stored.push_back(std::move(stored));
  }
  return absl::OkStatus();
}

void JobExecution::Settle(LiveJob& live, Progress& progress,
                          const absl::Status& error) {
  const auto now = lifecycle_.Read(live.id);
  // Memory may have ended after it had moved.
  if (now.ok() && now->state == JobState::kSucceeded) return;
  if (!progress.started) {
    scheduler_.FailIfStill(JobState::kQueued, live.id, error);
    scheduler_.FailIfStill(JobState::kRunning, live.id, error);
    return;
  }
  retention_.RemoveParts(live.tenant, std::exchange(progress.stored, {}));
  // All are refused when it was cancelled, timed out or given up before.
  if (live.stop.stop_requested()) {
    live.awaited_bytes = 0;
    live.unreadable = 0;
    PutBack(*progress.started);
    return;
  }
  const bool waits = MayWaitForStorage(live, progress, error);
  // Else it would be nobody's until its lease ends.
  (void)WhenStoreAnswers(live, [&] {
    return waits ? Hold(live, *progress.started, error)
                 : lifecycle_.Fail(*progress.started, FinalError(live, error));
  });
}

void JobExecution::PutBack(const JobRecord& started) {
  const std::string& id = started.id;
  const auto record = lifecycle_.Read(id);
  if (!record.ok() || record->state != JobState::kRunning ||
      record->claim != started.claim) {
    return;
  }
  const bool is_fault = watchdog_.HasFreedMemory(id);
  if (is_fault && record->faults + 1 >= environment_.limits.max_faults) {
    (void)lifecycle_.Fail(
        *record, OutOfMemory("the server's memory grew beyond its limit each "
                             "time the job ran, and fell with its end"));
    return;
  }
  (void)lifecycle_.Move(id, JobState::kQueued, [&](JobRecord& now) {
    ISOMATCH_RETURN_IF_ERROR(CheckOwn(started, now));
    if (is_fault) {
      ++now.faults;
    } else {
      --now.attempt;  // it had no chance
    }
    return absl::OkStatus();
  });
}

bool JobExecution::MayWaitForStorage(LiveJob& live, const Progress& progress,
                                     const absl::Status& error) {
  // Where only what jobs need is in the way, waiting could be for ever: some
  // have to give way.
  const bool is_refused =
      IsStorageFailed(error) &&
      environment_.blobs->CanMakeRoom(progress.result_bytes);
  const bool is_unreadable = IsContentUnavailable(error);
  live.awaited_bytes = is_refused ? progress.result_bytes : 0;
  live.unreadable = is_unreadable ? live.unreadable + 1 : 0;
  if (!is_refused && !is_unreadable) return false;
  if (is_refused) scheduler_.CheckStorage();
  return live.unreadable <= kMostUnreadable;
}

absl::Status JobExecution::FinalError(const LiveJob& live,
                                      const absl::Status& error) {
  if (live.unreadable <= kMostUnreadable) return error;
  return ContentLost(live.id, DetailsOf(error).metadata["what"]);
}

absl::Status JobExecution::Hold(const LiveJob& live, const JobRecord& started,
                                const absl::Status& error) {
  const auto moved =
      lifecycle_.Move(live.id, JobState::kQueued, [&](JobRecord& now) {
        ISOMATCH_RETURN_IF_ERROR(CheckOwn(started, now));
        if (now.state != started.state) {
          return absl::FailedPreconditionError("too late");
        }
        --now.attempt;  // it was not the job's fault
        now.hold = HoldAfter(live.times_held);
        now.hold_reason = std::string(error.message());
        now.unreadable = live.unreadable;
        return absl::OkStatus();
      });
  return moved.status();
}

}  // namespace isomatch
