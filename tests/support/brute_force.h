#pragma once

#include <vector>

#include <Eigen/Core>

#include "core/base/vertex_index.h"
#include "core/matching/matching.h"

namespace isomatch {

// Slow second implementations, straight from the formulas.

/// Eq. 8 summed over ordered pairs, from the closeness of vertices.
double BruteForceEnergy(const PointPool& pool_x, const PointPool& pool_y,
                        const std::vector<PointMatch>& matches);

/// Eq. 4 as a mean over ordered pairs.
double BruteForceObjective(const PointPool& pool_x, const PointPool& pool_y,
                           const std::vector<PointMatch>& matches);

}  // namespace isomatch
