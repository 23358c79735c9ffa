#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/mesh/mesh_size.h"
#include "core/pipeline/match_options.h"

namespace isomatch {

/// Options that keep a match within its memory limit.
struct MemoryPlan {
  MatchOptions options;
  /// What was given up for the limit, in words for the user; empty when the
  /// result does not change.
  std::vector<std::string> warnings;
};

/// Returns `options` changed so that a match stays within
/// options.memory_limit_bytes: EstimateMemoryBytes of what it returns, which
/// bounds what Match takes, and the `held_bytes` that the caller holds
/// meanwhile are at most that together.
///
/// First there are fewer threads, down to one, which leaves the result as it
/// is. Then there are fewer solved vertices, and with them fewer basis points,
/// down to kFewestPlannedVertices. The result depends on sizes, options and
/// limit only, not on the machine. Without a limit the options are not changed.
///
/// INVALID_ARGUMENT, naming options.memory_limit_bytes and the least that would
/// do: the limit is too low. REQUIRES: valid options.
absl::StatusOr<MemoryPlan> PlanWithinMemory(MeshSize x, MeshSize y,
                                            std::int64_t num_landmarks,
                                            const MatchOptions& options,
                                            std::int64_t held_bytes = 0);

/// The size of a mesh, and of what decimation left of it; the same where none
/// was asked for.
struct DecimatedSize {
  MeshSize mesh;
  MeshSize left;
};

/// Whether decimation left about as many vertices as options.solved_vertices
/// asks for, or was not asked for.
bool IsDecimatedWell(MeshSize left, const MatchOptions& options);

/// Checks that matching stays within options.memory_limit_bytes although a mesh
/// could not be decimated well. RESOURCE_EXHAUSTED, with the numbers, when it
/// does not; OK without a limit, or when both are decimated well. A mesh that
/// is not known yet counts as an empty one.
absl::Status CheckDecimated(const DecimatedSize& x, const DecimatedSize& y,
                            const MatchOptions& options);

/// The fewest vertices that a plan solves on. With fewer, maps of
/// near-isometric shapes get noticeably worse; see core/EXPERIMENTS.md, "Large
/// meshes".
inline constexpr int kFewestPlannedVertices = 1000;

}  // namespace isomatch
