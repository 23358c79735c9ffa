#pragma once

#include <utility>
#include <vector>

#include "core/pipeline/match_options.h"
#include "core/pipeline/progress.h"

namespace isomatch {

/// Eigenpairs that a run with these options needs of each mesh.
int SpectralCount(const MatchOptions& options);

/// The stages of a run, in order, with their rough share of its time.
std::vector<std::pair<Stage, double>> StagePlan(const MatchOptions& options);

}  // namespace isomatch
