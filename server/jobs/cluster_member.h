#pragma once

#include <cstdint>
#include <map>
#include <string>

#include "absl/time/time.h"
#include "core/base/mutex.h"
#include "server/jobs/job_environment.h"
#include "server/jobs/job_lifecycle.h"
#include "server/jobs/job_retention.h"
#include "server/jobs/job_scheduler.h"
#include "server/storage/shared_job_store.h"

namespace isomatch {

/// What a process does for and hears from the others that share its store:
///
///   Renew    twice a second: its jobs go on, this far; those that are not its
///            own any more (cancelled at another process, or given to another
///            worker) are asked to stop
///   Follow   four times a second: those who watch a job here hear that it has
///            changed
///   DoChores once a second, by one of the processes: jobs whose workers are
///            silent go back to the queue, those that have waited too long
///            fail, those that nobody watches are cancelled if they want it so;
///            once a minute old jobs go, and blobs that could not go before
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

 private:
  void Renew();
  void Follow();
  void DoChores();
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
  absl::Duration registered_ = -absl::InfiniteDuration();
  absl::Duration told_watched_ = -absl::InfiniteDuration();
  absl::Duration pruned_ = -absl::InfiniteDuration();
  /// When the store last did not answer, or only late.
  absl::Duration silent_ = -absl::InfiniteDuration();
  /// Of the jobs that are watched here: the change that watchers know of.
  std::map<std::string, std::uint64_t> sequences_;

  Mutex mutex_;
  bool is_stopped_ ABSL_GUARDED_BY(mutex_) = false;
  bool has_left_ ABSL_GUARDED_BY(mutex_) = false;
  Executor::Timer renew_timer_ ABSL_GUARDED_BY(mutex_);
  Executor::Timer follow_timer_ ABSL_GUARDED_BY(mutex_);
  Executor::Timer chores_timer_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace isomatch
