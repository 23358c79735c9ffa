#pragma once

#include <stop_token>

#include "absl/status/statusor.h"
#include "core/pipeline/correspondence.h"
#include "core/pipeline/progress.h"
#include "server/jobs/job_spec.h"
#include "server/jobs/match_engine.h"
#include "server/jobs/prepared_cache.h"

namespace isomatch {

/// The same result as engine.match of the job's meshes; shapes that the cache
/// has are not prepared again, others are and kept there. Progress never falls.
/// Errors as Match.
absl::StatusOr<Correspondence> MatchWithCache(const MatchEngine& engine,
                                              const JobSpec& spec,
                                              PreparedCache& cache,
                                              const ProgressCallback& progress,
                                              const std::stop_token& stop);

}  // namespace isomatch
