#pragma once

#include <cstdint>
#include <stop_token>

#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "core/mesh/triangle_mesh.h"
#include "core/pipeline/correspondence.h"
#include "core/pipeline/match_options.h"
#include "core/pipeline/prepared_shape.h"
#include "core/pipeline/progress.h"

namespace isomatch {

/// Finds the dense correspondence from X to Y: for every vertex of X its place
/// on Y (Holzschuh, Laehner, Cremers: Simulated Annealing for 3D Shape
/// Correspondence, 3DV 2020): PrepareBoth and MatchPrepared, which the service
/// calls one by one to keep what is prepared.
///
/// The meshes may have different vertex counts. `landmarks`, when given, take
/// the place of generated seeds. The result depends on meshes, landmarks,
/// options and options.random_seed only, not on the number of threads.
///
/// INVALID_ARGUMENT: a mesh, landmark or option is wrong; the message names
/// field, value and what was expected. CANCELLED: control.stop was requested;
/// the call returns within a quarter of a second, but for meshes of a million
/// vertices, which are cleaned in few steps, and the sparse factorization of
/// large ones without decimation, which is not interrupted. RESOURCE_EXHAUSTED:
/// a mesh cannot be decimated and needs more than options.memory_limit_bytes.
/// INTERNAL: a numerical step failed.
///
/// Time and memory O(n) beyond MatchOptions::solved_vertices. Without that time
/// O(n log n sqrt(n)) up to the nearest neighbors, memory O(n sqrt(n)).
/// EstimateMemoryBytes bounds the memory.
absl::StatusOr<Correspondence> Match(const TriangleMesh& mesh_x,
                                     const TriangleMesh& mesh_y,
                                     absl::Span<const Landmark> landmarks,
                                     const MatchOptions& options,
                                     const MatchControl& control = {});

/// Prepares a mesh for MatchPrepared with these options. Errors as Match;
/// `mesh` is named "mesh". Reports the first three stages. Of two meshes no
/// limit can be planned for one alone: with options.memory_limit_bytes, prepare
/// with the options of PlanWithinMemory.
absl::StatusOr<PreparedShape> Prepare(SharedMesh mesh,
                                      const MatchOptions& options,
                                      const MatchControl& control = {});

/// Prepares those of the two that are not prepared yet, both at the same time
/// where threads allow. Errors as Match.
absl::StatusOr<PreparedPair> PrepareBoth(ShapeSource x, ShapeSource y,
                                         const MatchOptions& options,
                                         const MatchControl& control = {});

/// Match, of prepared shapes: the same result as of their meshes. A shape of
/// which the caller keeps no copy may be changed, which saves memory.
/// INVALID_ARGUMENT also when one was prepared for other options; the message
/// names the option. All stages are reported, those of the preparation as
/// well (see JoinedProgress).
absl::StatusOr<Correspondence> MatchPrepared(
    PreparedShape x, PreparedShape y, absl::Span<const Landmark> landmarks,
    const MatchOptions& options, const MatchControl& control = {});

/// Checks landmarks as Match does: every index in range, no vertex of X or Y in
/// two of them. The message names `landmarks[i]`.
absl::Status ValidateLandmarks(absl::Span<const Landmark> landmarks,
                               std::int64_t vertices_x,
                               std::int64_t vertices_y);

}  // namespace isomatch
