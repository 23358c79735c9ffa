#include "core/pipeline/shape_contents.h"

#include "core/pipeline/stage_plan.h"

namespace isomatch {

PreparationKey PreparationKey::Of(const MatchOptions& options) {
  PreparationKey key;
  key.solved_vertices = options.solved_vertices;
  key.pool_size = options.pool_size;
  key.eigenpairs = SpectralCount(options);
  if (options.curvature_weight > 0) {
    key.curvature_radius = options.curvature_radius;
  }
  if (options.alignment_rounds > 0) {
    key.descriptor_radius = options.descriptor_radius;
  }
  return key;
}

}  // namespace isomatch
