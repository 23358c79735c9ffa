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
  /// What was given up for it, in words for the user; empty when nothing was
  /// that changes the result.
  std::vector<std::string> warnings;
};

/// Fits `options` to options.memory_limit_bytes: EstimateMemoryBytes of what it
/// returns, which bounds the memory that Match takes, and the `held_bytes` that
/// the caller holds meanwhile are at most that together. First
/// fewer threads, down to one, which leaves the result as it is; then fewer
/// solved vertices, and with them fewer basis points, down to
/// kFewestPlannedVertices. The result depends on sizes, options and limit only,
/// not on the machine. Without a limit the options come back as they are.
///
/// INVALID_ARGUMENT, naming options.memory_limit_bytes and the least that would
/// do: the limit is too low. REQUIRES: valid options.
absl::StatusOr<MemoryPlan> PlanWithinMemory(MeshSize x, MeshSize y,
                                            std::int64_t num_landmarks,
                                            const MatchOptions& options,
                                            std::int64_t held_bytes = 0);

/// A mesh and what decimation, where it was asked for, left of it.
struct DecimatedSize {
  MeshSize mesh;
  MeshSize left;
};

/// Whether about as many vertices are left as options.solved_vertices asks for,
/// or no decimation was asked for.
bool IsDecimatedWell(MeshSize left, const MatchOptions& options);

/// Checks that matching stays within options.memory_limit_bytes although a mesh
/// could not be decimated well. RESOURCE_EXHAUSTED, with the numbers, when it
/// does not; without a limit, or when both are decimated well, all is well. A
/// mesh that is not known yet is taken for one of nothing.
absl::Status CheckDecimated(const DecimatedSize& x, const DecimatedSize& y,
                            const MatchOptions& options);

/// With fewer, maps of near-isometric shapes get noticeably worse; see
/// core/EXPERIMENTS.md, "Large meshes".
inline constexpr int kFewestPlannedVertices = 1000;

}  // namespace isomatch
