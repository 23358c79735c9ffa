#pragma once

#include <cstdint>

#include "core/mesh/triangle_mesh.h"
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

struct PreparedShape::Contents {
  TriangleMesh mesh;
  PreparationKey key;
  PreparedMesh prepared;
  std::int32_t large_components = 1;
};

}  // namespace isomatch
