#pragma once

#include <stop_token>

#include "absl/status/statusor.h"
#include "core/pipeline/correspondence.h"
#include "core/pipeline/match_engine.h"
#include "core/pipeline/progress.h"
#include "server/engine/job_spec.h"
#include "server/engine/prepared_cache.h"

namespace isomatch {

/// Matches the job's meshes; shapes that the cache has are not prepared again,
/// others are and kept there. Uses up the meshes. Errors as Match.
absl::StatusOr<Correspondence> MatchWithCache(const MatchEngine& engine,
                                              JobSpec& spec,
                                              PreparedCache& cache,
                                              const MatchControl& control);

}  // namespace isomatch
