#pragma once

#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "core/pipeline/correspondence.h"
#include "core/pipeline/match_options.h"
#include "core/pipeline/part_start.h"
#include "core/pipeline/prepared_mesh.h"
#include "core/pipeline/progress.h"
#include "core/pipeline/progress_reporter.h"

namespace isomatch {

/// What a match goes out from. References must outlive it.
struct MatchInputs {
  const PreparedMesh& x;
  /// &x where it may be changed, which spares a copy when its mirror image is
  /// matched; or nullptr.
  PreparedMesh* own_x;
  const PreparedMesh& y;
  absl::Span<const Landmark> landmarks;
  const MatchOptions& options;
  /// How it begins where X is a part of Y, with X in its scale; else nullptr.
  const PartStart* part = nullptr;
};

/// Match of two prepared meshes, from the seeds on: the stages of preparation
/// are reported before. REQUIRES: both were prepared for these options.
absl::StatusOr<Correspondence> RunMatch(const MatchInputs& inputs,
                                        ProgressReporter* progress,
                                        const StopTokens& stops);

}  // namespace isomatch
