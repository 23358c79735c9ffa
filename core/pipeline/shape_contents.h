#pragma once

#include <cstdint>
#include <optional>
#include <stop_token>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "core/pipeline/component_matching.h"
#include "core/pipeline/match_options.h"
#include "core/pipeline/prepared_mesh.h"
#include "core/pipeline/prepared_shape.h"

namespace isomatch {

/// The options that preparation depends on.
struct PreparationKey {
  std::int32_t solved_vertices = 0;
  std::int32_t pool_size = 0;
  std::int32_t eigenpairs = 0;
  double curvature_radius = 0;   ///< 0 without
  double descriptor_radius = 0;  ///< 0 without

  static PreparationKey Of(const MatchOptions& options);
};

/// Either `whole` or `split` is set once the shape is prepared.
struct PreparedShape::Contents {
  SharedMesh mesh;
  PreparationKey key = {};
  std::int32_t large_components = 1;
  std::optional<PreparedMesh> whole = std::nullopt;
  /// Set for a shape whose components are matched one by one.
  std::optional<SplitMesh> split = std::nullopt;
};

/// ParsePreparedShape, compiled with this core.
absl::StatusOr<PreparedShape> ParsePreparedShapeHere(
    absl::string_view bytes, const std::stop_token& stop);

}  // namespace isomatch
