#pragma once

#include <cstddef>
#include <utility>
#include <vector>

#include "core/matching/first_stage.h"
#include "core/pipeline/match_options.h"
#include "core/pipeline/progress.h"

namespace isomatch {

/// Eigenpairs that a run with these options needs of each mesh.
int SpectralCount(const MatchOptions& options);

/// What the options say of the first stage, with this many landmarks.
FirstStageOptions FirstStageOptionsOf(const MatchOptions& options,
                                      std::size_t num_landmarks);

/// The stages of a run, in order, with their rough share of its time.
std::vector<std::pair<Stage, double>> StagePlan(const MatchOptions& options);

}  // namespace isomatch
