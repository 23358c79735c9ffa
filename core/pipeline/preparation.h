#pragma once

#include <array>
#include <optional>
#include <stop_token>
#include <string>

#include "absl/status/status.h"
#include "core/mesh/clean_mesh.h"
#include "core/pipeline/match_options.h"
#include "core/pipeline/prepared_mesh.h"
#include "core/pipeline/progress_reporter.h"

namespace isomatch {

/// A mesh that is to be prepared.
struct MeshToPrepare {
  CleanMesh clean;
  /// What errors call it.
  std::string field;
};

/// Fills a prepared mesh from each mesh, stage by stage, both at the same time
/// where threads allow; where `meshes` has none there is nothing to do, and the
/// stages are reported all the same. Errors as Match.
absl::Status PrepareMeshes(std::array<std::optional<MeshToPrepare>, 2> meshes,
                           const MatchOptions& options,
                           ProgressReporter* progress,
                           const std::stop_token& stop,
                           std::array<PreparedMesh, 2>* prepared);

}  // namespace isomatch
