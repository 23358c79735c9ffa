#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "core/base/mutex.h"
#include "server/jobs/job_environment.h"
#include "server/jobs/job_lifecycle.h"
#include "server/jobs/job_retention.h"
#include "server/jobs/job_scheduler.h"
#include "server/storage/shared_job_store.h"

namespace isomatch {

/// What a process knows of the store that it shares, and of the others.
struct ClusterView {
  /// OK; UNAVAILABLE: the store did not answer when it was asked last;
  /// FAILED_PRECONDITION: it is too new for this program; any other: it refuses
  /// what a process has to do.
  absl::Status store;
  /// See SharedJobStore.
  std::int64_t store_errors = 0;

  /// What the store has told, all at the same time.
  struct Told {
    QueueCounts queue;
    int workers = 0;
    StoreFigures store;
    std::int64_t stored_bytes = 0;
  };
  /// Not set before it has told it; whether that was in the last 15 s.
  std::optional<Told> told;
  bool is_recent = false;
};

/// What a process does for and hears from the others that share its store:
///
///   Renew    twice a second: its jobs go on, this far; those that are not its
///            own any more (cancelled at another process, or given to another
///            worker) are asked to stop
///   Follow   four times a second: those who watch a job here hear that it has
///            changed
///   Take     five times a second: what waits and fits starts here
///   DoChores once a second, by one of the processes: jobs whose workers are
///            silent go back to the queue, those that have waited too long
///            fail, those that nobody watches are cancelled if they want it so;
///            once a minute old jobs go, blobs that could not go before, and
///            uploads that did not go on
///   Observe  each five seconds: how it stands with store and queue, for those
///            who look after them
///
/// While the store does not answer all that waits until it does, and workers
/// and watchers have a whole lease from then on to say that they are there.
/// Thread-safe.
class ClusterMember {
 public:
  ClusterMember(const JobEnvironment& environment, JobLifecycle* lifecycle,
                JobRetention* retention, JobScheduler* scheduler)
      : environment_(environment),
        lifecycle_(*lifecycle),
        retention_(*retention),
        scheduler_(*scheduler) {}

  /// From now on it is one of them.
  void Begin();

  /// It takes no job any more.
  void Leave();

  /// Nothing is done by itself any more.
  void Stop();

  /// Returns what is known, without asking.
  ClusterView view() const;

 private:
  void Renew();
  void RenewLeases();
  void Register();
  void Follow();
  void Take();
  void DoChores();
  void Observe();
  /// Remembers whether the store has answered.
  void Hear(const absl::Status& answer);
  /// What is asked all the time, so that a refusal is not forgotten for the
  /// answer to something else.
  enum Asked { kVersionOfStore, kClaims, kChoresOfAll, kNumAsked };
  /// The same of whether it refuses what a process has to do.
  void HearRefusal(Asked asked, const absl::Status& answer);
  /// The same of its version: no job is taken from one that is too new.
  void HearVersion(const absl::Status& version);
  /// A job that runs here by this claim is not this process's own any more.
  void OnLost(const std::string& id, std::uint64_t claim);
  void TakeBackExpired();
  void EndOverdue();
  void EndUnwatched();
  /// Runs `loop` again after `pause`, until Stop; `timer` is its own.
  void Again(Executor::Timer& timer, absl::Duration pause,
             void (ClusterMember::*loop)());

  const JobEnvironment& environment_;
  JobLifecycle& lifecycle_;
  JobRetention& retention_;
  JobScheduler& scheduler_;
  // Each used by one loop only.
  /// When all leases that are left had been renewed, at the latest.
  absl::Duration renewed_ = -absl::InfiniteDuration();
  absl::Duration registered_ = -absl::InfiniteDuration();
  absl::Duration told_watched_ = -absl::InfiniteDuration();
  absl::Duration pruned_ = -absl::InfiniteDuration();
  /// When the store last did not answer, or only late.
  absl::Duration silent_ = -absl::InfiniteDuration();
  /// Of the jobs that are watched here: the change that watchers know of.
  std::map<std::string, std::uint64_t> sequences_;

  mutable Mutex mutex_;
  /// UNAVAILABLE or OK, and when the store answered last.
  absl::Status answer_ ABSL_GUARDED_BY(mutex_);
  absl::Duration answered_ ABSL_GUARDED_BY(mutex_) = -absl::InfiniteDuration();
  std::array<absl::Status, kNumAsked> refusals_ ABSL_GUARDED_BY(mutex_);
  std::optional<ClusterView::Told> told_ ABSL_GUARDED_BY(mutex_);
  absl::Duration told_at_ ABSL_GUARDED_BY(mutex_) = -absl::InfiniteDuration();
  bool is_stopped_ ABSL_GUARDED_BY(mutex_) = false;
  bool has_left_ ABSL_GUARDED_BY(mutex_) = false;
  Executor::Timer renew_timer_ ABSL_GUARDED_BY(mutex_);
  Executor::Timer follow_timer_ ABSL_GUARDED_BY(mutex_);
  Executor::Timer take_timer_ ABSL_GUARDED_BY(mutex_);
  Executor::Timer chores_timer_ ABSL_GUARDED_BY(mutex_);
  Executor::Timer observe_timer_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace isomatch
