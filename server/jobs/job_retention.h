#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/base/mutex.h"
#include "server/jobs/disk_work.h"
#include "server/jobs/job_environment.h"
#include "server/storage/job_record.h"

namespace isomatch {

/// How long jobs and their bytes stay. A job names its request, its meshes and,
/// once it has SUCCEEDED, its results; they are pinned in the blob store while
/// they must not go: inputs until the job is terminal, results until it is
/// forgotten. Thread-safe.
class JobRetention {
 public:
  JobRetention(const JobEnvironment& environment, DiskWork* disk)
      : environment_(environment), disk_(*disk) {}

  /// From now on forgets old jobs by itself, and now.
  void Begin() { ForgetOld(); }

  /// Forgets none by itself any more.
  void Stop();

  /// Pins what the job of an earlier process names.
  void Pin(const JobRecord& record);

  /// The job needs its inputs no more.
  void UnpinInputs(const JobRecord& record);

  /// Removes parts of a result that were stored, if nobody else has them.
  void RemoveParts(const std::string& tenant,
                   const std::vector<StoredPart>& parts);

  /// Forgets the jobs that are too old or too many, and results of so many
  /// bytes.
  void Prune(std::int64_t room_bytes = 0);

  /// Removes what only this job named, which the store has no more.
  void OnDeleted(const JobRecord& removed);

 private:
  void ForgetOld();
  /// Removes the results of jobs that are gone, and their requests.
  void RemoveResults(const std::vector<JobRecord>& removed);

  const JobEnvironment& environment_;
  DiskWork& disk_;
  Mutex mutex_;
  bool is_stopped_ ABSL_GUARDED_BY(mutex_) = false;
  /// Runs the next ForgetOld.
  Executor::Timer timer_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace isomatch
