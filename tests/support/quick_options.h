#pragma once

#include "core/pipeline/match_options.h"

namespace isomatch {

/// The default profile with fewer seeds and smaller bases, to keep tests quick.
inline MatchOptions QuickOptions() {
  MatchOptions options;
  options.first_stage_matches = 80;
  options.seed_points = 5;
  options.max_seeds = 200;
  options.selection_rounds = {{12, 40}, {40, 10}};
  options.pool_size = 400;
  options.alignment_basis = 60;
  return options;
}

}  // namespace isomatch
