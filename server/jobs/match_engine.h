#pragma once

#include <cstdint>
#include <functional>
#include <stop_token>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "core/mesh/mesh_size.h"
#include "core/pipeline/correspondence.h"
#include "core/pipeline/match_options.h"
#include "core/pipeline/memory_plan.h"
#include "core/pipeline/prepared_shape.h"
#include "core/pipeline/progress.h"

namespace isomatch {

/// The part of core/pipeline that the server calls, as values, so that tests
/// can put something quick, slow or broken in its place.
struct MatchEngine {
  /// As Match.
  std::function<absl::StatusOr<Correspondence>(
      const TriangleMesh& mesh_x, const TriangleMesh& mesh_y,
      absl::Span<const Landmark> landmarks, const MatchOptions& options,
      const ProgressCallback& progress, std::stop_token stop)>
      match;
  /// As Prepare, PrepareBoth and MatchPrepared.
  std::function<absl::StatusOr<PreparedShape>(
      TriangleMesh mesh, const MatchOptions& options,
      const ProgressCallback& progress, std::stop_token stop)>
      prepare;
  std::function<absl::StatusOr<PreparedPair>(
      TriangleMesh mesh_x, TriangleMesh mesh_y, const MatchOptions& options,
      const ProgressCallback& progress, std::stop_token stop)>
      prepare_both;
  std::function<absl::StatusOr<Correspondence>(
      const PreparedShape& x, const PreparedShape& y,
      absl::Span<const Landmark> landmarks, const MatchOptions& options,
      const ProgressCallback& progress, std::stop_token stop)>
      match_prepared;
  /// As EstimatePreparedExtraBytes.
  std::function<std::int64_t(MeshSize x, MeshSize y,
                             const MatchOptions& options)>
      estimate_prepared_extra;
  /// As EstimateMemoryBytes.
  std::function<std::int64_t(MeshSize x, MeshSize y, std::int64_t num_landmarks,
                             const MatchOptions& options)>
      estimate;
  /// As PlanWithinMemory.
  std::function<absl::StatusOr<MemoryPlan>(
      MeshSize x, MeshSize y, std::int64_t num_landmarks,
      const MatchOptions& options, std::int64_t held_bytes)>
      plan;
  /// As ValidateLandmarks.
  std::function<absl::Status(absl::Span<const Landmark> landmarks,
                             std::int64_t vertices_x, std::int64_t vertices_y)>
      validate_landmarks;
};

/// Returns the functions of core/pipeline.
MatchEngine CoreMatchEngine();

}  // namespace isomatch
