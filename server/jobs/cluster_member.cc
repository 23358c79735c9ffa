#include "server/jobs/cluster_member.h"

#include <utility>
#include <vector>

#include "core/base/version.h"
#include "server/jobs/errors.h"
#include "server/jobs/within_memory.h"

namespace isomatch {
namespace {

constexpr absl::Duration kRenewInterval = absl::Milliseconds(500);
constexpr absl::Duration kFollowInterval = absl::Milliseconds(250);
constexpr absl::Duration kChoresInterval = absl::Seconds(1);
constexpr absl::Duration kRegisterInterval = absl::Seconds(5);
constexpr absl::Duration kWatchedInterval = absl::Seconds(2);
constexpr absl::Duration kPruneInterval = absl::Minutes(1);

/// How long the others wait for whoever does the chores.
constexpr absl::Duration kChoresTerm = absl::Seconds(5);
constexpr char kChores[] = "jobs";

}  // namespace

void ClusterMember::Begin() {
  Renew();
  Follow();
  DoChores();
}

void ClusterMember::Leave() {
  {
    MutexLock lock(mutex_);
    has_left_ = true;
  }
  (void)environment_.shared->Unregister(environment_.process);
}

void ClusterMember::Stop() {
  Executor::Timer renew;  // dropped after the lock
  Executor::Timer follow;
  Executor::Timer chores;
  MutexLock lock(mutex_);
  is_stopped_ = true;
  std::swap(renew, renew_timer_);
  std::swap(follow, follow_timer_);
  std::swap(chores, chores_timer_);
}

void ClusterMember::Again(Executor::Timer& timer, absl::Duration pause,
                          void (ClusterMember::*loop)()) {
  Executor::Timer next =
      environment_.cluster->PostAfter(pause, [this, loop] { (this->*loop)(); });
  MutexLock lock(mutex_);
  if (!is_stopped_) std::swap(timer, next);
}

void ClusterMember::Renew() {
  const std::vector<LeasedJob> jobs = scheduler_.runs().Leased();
  if (!jobs.empty()) {
    const auto lost = environment_.shared->Renew(jobs, environment_.lease);
    if (lost.ok()) {
      for (const std::string& id : *lost) scheduler_.AskToStop(id);
    }
  }
  const absl::Duration now = environment_.uptime();
  bool registers = environment_.limits.workers > 0;
  {
    MutexLock lock(mutex_);
    registers = registers && !has_left_;
  }
  if (registers && now - registered_ > kRegisterInterval &&
      environment_.shared
          ->Register({environment_.process, kVersion,
                      environment_.limits.workers, environment_.threads_per_job,
                      environment_.budget->total_bytes()})
          .ok()) {
    registered_ = now;
  }
  Again(renew_timer_, kRenewInterval, &ClusterMember::Renew);
}

void ClusterMember::Follow() {
  const std::vector<std::string> ids = lifecycle_.watchers().Ids();
  if (!ids.empty()) {
    const auto live = environment_.shared->LiveSequences(ids);
    std::map<std::string, std::uint64_t> sequences;
    for (const std::string& id : ids) {
      if (!live.ok()) break;
      const auto found = live->find(id);
      const std::uint64_t sequence = found == live->end() ? 0 : found->second;
      sequences[id] = sequence;
      const auto known = sequences_.find(id);
      // One that is over is told until nobody watches it any more.
      if (sequence == 0 || known == sequences_.end() ||
          known->second != sequence) {
        lifecycle_.watchers().Notify(id);
      }
    }
    if (live.ok()) sequences_ = std::move(sequences);
    const absl::Duration now = environment_.uptime();
    if (now - told_watched_ > kWatchedInterval &&
        environment_.shared
            ->KeepWatched(
                ids, kWatchedInterval + environment_.limits.unwatched_grace)
            .ok()) {
      told_watched_ = now;
    }
  }
  Again(follow_timer_, kFollowInterval, &ClusterMember::Follow);
}

void ClusterMember::DoChores() {
  const absl::Duration asked = environment_.uptime();
  const auto holds = environment_.shared->HoldChore(
      kChores, environment_.process, kChoresTerm);
  const absl::Duration now = environment_.uptime();
  // Others may have waited as long as this one.
  if (!holds.ok() || now - asked > environment_.lease / 2) silent_ = now;
  if (holds.ok() && *holds) {
    if (now - silent_ > environment_.lease) {
      TakeBackExpired();
      EndUnwatched();
    }
    EndOverdue();
    if (now - pruned_ > kPruneInterval) {
      retention_.Prune();
      environment_.blobs->Tidy();
      pruned_ = now;
    }
  }
  Again(chores_timer_, kChoresInterval, &ClusterMember::DoChores);
}

void ClusterMember::TakeBackExpired() {
  const auto expired = environment_.shared->Expired(environment_.lease);
  if (!expired.ok()) return;
  const JobLimits& limits = environment_.limits;
  std::map<std::string, int> jobs_of_worker;
  for (const JobRecord& job : *expired) ++jobs_of_worker[job.worker];
  for (const JobRecord& job : *expired) {
    // Of several it is not known whose fault it was: more than a few starts
    // and each runs alone.
    const bool is_to_blame = jobs_of_worker[job.worker] == 1;
    const std::int32_t faults = job.faults + (is_to_blame ? 1 : 0);
    const bool is_over =
        faults >= limits.max_faults || job.attempt >= limits.max_attempts;
    if (!is_over) {
      (void)environment_.shared->TakeBack(job, faults);
      continue;
    }
    lifecycle_.Fail(
        job,
        CrashedRepeatedly(faults >= limits.max_faults ? faults : job.attempt));
  }
}

void ClusterMember::EndOverdue() {
  const auto overdue = environment_.shared->Overdue();
  if (!overdue.ok()) return;
  for (const JobRecord& job : *overdue) {
    lifecycle_.Fail(
        job, QueueTimeout(job.queue_timeout.value_or(absl::ZeroDuration())));
  }
}

void ClusterMember::EndUnwatched() {
  const auto unwatched = environment_.shared->Unwatched();
  if (!unwatched.ok()) return;
  for (const std::string& id : *unwatched) {
    (void)scheduler_.Stop(id, JobState::kCancelled);
  }
}

}  // namespace isomatch
