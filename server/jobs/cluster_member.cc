#include "server/jobs/cluster_member.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/version.h"
#include "server/jobs/errors.h"
#include "server/jobs/within_memory.h"

namespace isomatch {
namespace {

constexpr absl::Duration kRenewInterval = absl::Milliseconds(500);
constexpr absl::Duration kFollowInterval = absl::Milliseconds(250);
constexpr absl::Duration kTakeInterval = absl::Milliseconds(200);
constexpr absl::Duration kChoresInterval = absl::Seconds(1);
constexpr absl::Duration kObserveInterval = absl::Seconds(5);
constexpr absl::Duration kRegisterInterval = absl::Seconds(5);
constexpr absl::Duration kWatchedInterval = absl::Seconds(2);
constexpr absl::Duration kPruneInterval = absl::Minutes(1);

/// How long the others wait for whoever does the chores.
constexpr absl::Duration kChoresTerm = absl::Seconds(5);
constexpr char kChores[] = "jobs";

/// How long a store may say nothing that is asked each second.
constexpr absl::Duration kStoreSilence = absl::Seconds(5);

/// How old what it told may be.
constexpr absl::Duration kToldAge = absl::Seconds(15);

}  // namespace

void ClusterMember::Begin() {
  // The others may not have reached the store either until now.
  silent_ = environment_.uptime();
  Renew();
  Follow();
  Take();
  DoChores();
  Observe();
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
  Executor::Timer take;
  Executor::Timer chores;
  Executor::Timer observe;
  MutexLock lock(mutex_);
  is_stopped_ = true;
  std::swap(renew, renew_timer_);
  std::swap(follow, follow_timer_);
  std::swap(take, take_timer_);
  std::swap(chores, chores_timer_);
  std::swap(observe, observe_timer_);
}

ClusterView ClusterMember::view() const {
  const absl::Duration now = environment_.uptime();
  ClusterView view;
  view.store_errors = environment_.shared->errors();
  MutexLock lock(mutex_);
  view.told = told_;
  view.is_recent = now - told_at_ < kToldAge;
  if (!answer_.ok()) {
    view.store = answer_;
  } else if (now - answered_ > kStoreSilence) {
    view.store = absl::UnavailableError(absl::StrCat(
        "database: no answer for ", absl::FormatDuration(kStoreSilence)));
  } else {
    for (const absl::Status& refusal : refusals_) view.store.Update(refusal);
  }
  return view;
}

void ClusterMember::Hear(const absl::Status& answer) {
  const absl::Duration now = environment_.uptime();
  // Other errors are answers.
  const absl::Status heard =
      absl::IsUnavailable(answer) ? answer : absl::OkStatus();
  bool is_news = false;
  {
    MutexLock lock(mutex_);
    is_news = heard.ok() != answer_.ok();
    answer_ = heard;
    if (heard.ok()) answered_ = now;
  }
  if (is_news) environment_.on_database(heard);
}

void ClusterMember::HearRefusal(Asked asked, const absl::Status& answer) {
  // These pass by themselves, and Hear has heard them.
  if (absl::IsUnavailable(answer) || absl::IsAborted(answer)) return;
  bool is_news = false;
  {
    MutexLock lock(mutex_);
    is_news = answer.ok() != refusals_[asked].ok();
    refusals_[asked] = answer;
  }
  if (is_news) environment_.on_database(answer);
}

void ClusterMember::HearVersion(const absl::Status& version) {
  if (!version.ok() && !absl::IsFailedPrecondition(version)) return;
  scheduler_.LetClaim(version.ok());
  HearRefusal(kVersionOfStore, version);
}

void ClusterMember::Again(Executor::Timer& timer, absl::Duration pause,
                          void (ClusterMember::*loop)()) {
  Executor::Timer next =
      environment_.cluster->PostAfter(pause, [this, loop] { (this->*loop)(); });
  MutexLock lock(mutex_);
  if (!is_stopped_) std::swap(timer, next);
}

void ClusterMember::Renew() {
  RenewLeases();
  Register();
  Again(renew_timer_, kRenewInterval, &ClusterMember::Renew);
}

void ClusterMember::RenewLeases() {
  const absl::Duration now = environment_.uptime();
  const std::vector<LeasedJob> jobs = scheduler_.runs().Leased();
  if (!jobs.empty()) {
    const auto lost = environment_.shared->Renew(jobs, environment_.lease);
    Hear(lost.status());
    if (!lost.ok()) return;
    for (const LeasedJob& job : jobs) {
      const auto found = std::find(lost->begin(), lost->end(), job.id);
      if (found != lost->end()) OnLost(job.id, job.claim);
    }
  }
  renewed_ = now;
}

void ClusterMember::Register() {
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
}

void ClusterMember::OnLost(const std::string& id, std::uint64_t claim) {
  RunningJobs& runs = scheduler_.runs();
  if (runs.ClaimOf(id) != claim) return;  // over, or claimed here again
  const bool was_asked = runs.WasAskedToStop(id);
  scheduler_.AskToStop(id);
  if (was_asked) return;  // the others or this process know why
  const auto job = lifecycle_.Read(id);
  if (!job.ok()) return;
  // It may have ended here or been cancelled, or by now be claimed here again.
  const bool had_expired =
      environment_.uptime() - renewed_ > environment_.lease;
  const bool is_others = IsTerminal(job->state)
                             ? had_expired && job->state != JobState::kCancelled
                             : job->claim != claim;
  if (!is_others) return;
  environment_.metrics->LeaseLost();
  environment_.on_lease_lost(*job, /*is_ours=*/true);
}

void ClusterMember::Follow() {
  const std::vector<std::string> ids = lifecycle_.watchers().Ids();
  if (!ids.empty()) {
    const auto live = environment_.shared->LiveSequences(ids);
    Hear(live.status());
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

void ClusterMember::Take() {
  scheduler_.Dispatch();
  HearRefusal(kClaims, scheduler_.last_claim());
  Again(take_timer_, kTakeInterval, &ClusterMember::Take);
}

void ClusterMember::Observe() {
  SharedJobStore& store = *environment_.shared;
  const absl::Status version = store.CheckVersion();
  const auto queue = store.Count();
  const auto workers = store.Workers(kWorkerAge);
  const auto figures = store.Measure();
  const std::int64_t stored_bytes = environment_.blobs->size_bytes();
  const absl::Duration now = environment_.uptime();
  Hear(figures.status());
  HearVersion(version);
  {
    MutexLock lock(mutex_);
    if (queue.ok() && workers.ok() && figures.ok()) {
      told_ = {*queue, static_cast<int>(workers->size()), *figures,
               stored_bytes};
      told_at_ = now;
    }
  }
  Again(observe_timer_, kObserveInterval, &ClusterMember::Observe);
}

void ClusterMember::DoChores() {
  const absl::Duration asked = environment_.uptime();
  const auto holds = environment_.shared->HoldChore(
      kChores, environment_.process, kChoresTerm);
  const absl::Duration now = environment_.uptime();
  // Others may have waited as long as this one.
  if (!holds.ok() || now - asked > environment_.lease / 2) silent_ = now;
  Hear(holds.status());
  HearRefusal(kChoresOfAll, holds.status());
  if (holds.ok() && *holds) {
    if (now - silent_ > environment_.lease) {
      TakeBackExpired();
      EndUnwatched();
    }
    EndOverdue();
    if (now - pruned_ > kPruneInterval) {
      retention_.Prune();
      environment_.blobs->Tidy();
      environment_.broken_uploads->Tidy();
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
    environment_.on_lease_lost(job, /*is_ours=*/false);
    // Of several it is not known whose fault it was: more than a few starts
    // and each runs alone.
    const bool is_to_blame = jobs_of_worker[job.worker] == 1;
    const std::int32_t faults = job.faults + (is_to_blame ? 1 : 0);
    const bool is_over =
        faults >= limits.max_faults || job.attempt >= limits.max_attempts;
    if (!is_over) {
      const auto is_taken = environment_.shared->TakeBack(job, faults);
      if (is_taken.ok() && *is_taken) environment_.metrics->LeaseExpired();
      continue;
    }
    environment_.metrics->LeaseExpired();
    (void)lifecycle_.Fail(
        job,
        CrashedRepeatedly(faults >= limits.max_faults ? faults : job.attempt));
  }
}

void ClusterMember::EndOverdue() {
  const auto overdue = environment_.shared->Overdue();
  if (!overdue.ok()) return;
  for (const JobRecord& job : *overdue) {
    (void)lifecycle_.Fail(
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
