#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "core/mesh/mesh_size.h"
#include "core/pipeline/correspondence.h"
#include "core/pipeline/match_engine.h"
#include "core/pipeline/progress.h"
#include "server/engine/job_spec.h"
#include "server/engine/prepared_cache.h"
#include "server/engine/result_parts.h"
#include "server/storage/job_record.h"

namespace isomatch {

/// What a job that succeeded leaves behind.
struct RunOutcome {
  std::vector<EncodedPart> parts;
  /// Without its `parts`, which whoever stores them fills in.
  JobResult result;
};

/// Runs the method on one job, by way of a MatchEngine. Thread-safe.
class JobRunner {
 public:
  using Clock = std::function<absl::Time()>;
  using OnProgress = std::function<void(const JobProgress&)>;
  using LoadSpec = std::function<absl::StatusOr<JobSpec>()>;

  /// Returns what is told about meshes and map, JobResult::info. The sizes are
  /// those of the spec's meshes, which have been used up.
  using DescribeResult =
      std::function<std::string(const JobSpec& spec, MeshSize size_x,
                                MeshSize size_y, const Correspondence& found)>;

  /// The shortest time between two calls of OnProgress within a stage.
  static constexpr absl::Duration kProgressInterval = absl::Milliseconds(100);

  /// `cache` outlives the runner.
  JobRunner(MatchEngine engine, DescribeResult describe, Clock now,
            PreparedCache& cache)
      : engine_(std::move(engine)),
        describe_(std::move(describe)),
        now_(std::move(now)),
        cache_(cache) {}

  /// Returns an upper bound on the bytes the job needs, its meshes included.
  std::int64_t EstimateBytes(const JobSpec& spec) const;

  /// Fits spec.options to its memory limit, if it has one, and adds to its
  /// warnings what was given up. INVALID_ARGUMENT naming
  /// options.memory_limit_bytes.
  absl::Status PlanMemory(JobSpec& spec) const;

  /// Landmarks that are in range and do not contradict each other.
  absl::Status ValidateLandmarks(const JobSpec& spec) const;

  /// Returns the parts and the figures, of the best map there is once `hurry`
  /// is requested. What `load` fails with; CANCELLED once `stop` is;
  /// RESOURCE_EXHAUSTED (OUT_OF_MEMORY) when an allocation failed, or the
  /// method would need more than EstimateBytes.
  absl::StatusOr<RunOutcome> Run(const LoadSpec& load,
                                 const OnProgress& on_progress,
                                 const StopTokens& stops) const;

 private:
  /// What the job holds beyond what matching its meshes takes: these, and
  /// prepared shapes that the cache may hold as well.
  static std::int64_t HeldBytes(const JobSpec& spec, bool with_cache);

  /// So that a mesh that cannot be decimated as it was estimated takes no more
  /// than the job has reserved.
  void LimitToEstimate(JobSpec& spec) const;

  const MatchEngine engine_;
  const DescribeResult describe_;
  const Clock now_;
  PreparedCache& cache_;
};

}  // namespace isomatch
