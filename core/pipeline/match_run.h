#pragma once

#include <stop_token>

#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "core/pipeline/correspondence.h"
#include "core/pipeline/match_options.h"
#include "core/pipeline/prepared_mesh.h"
#include "core/pipeline/progress_reporter.h"

namespace isomatch {

/// Match of two prepared meshes, from the seeds on: the stages of preparation
/// are reported before. `own_x`: &x where it may be changed, which spares a
/// copy when its mirror image is matched; or nullptr. REQUIRES: both were
/// prepared for these options.
absl::StatusOr<Correspondence> RunMatch(
    const PreparedMesh& x, PreparedMesh* own_x, const PreparedMesh& y,
    absl::Span<const Landmark> landmarks, const MatchOptions& options,
    ProgressReporter* progress, const std::stop_token& stop);

}  // namespace isomatch
