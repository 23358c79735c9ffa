#pragma once

#include <vector>

#include "core/matching/matching.h"

namespace isomatch {

/// Paper, Section 3.5.
struct SeedOptions {
  int points = 4;     ///< m, farthest points of each shape
  int matches = 3;    ///< k, matches of a seed; 1 <= k <= m
  int max_seeds = 0;  ///< best ones kept, 0 for all
};

/// One small injective map between points of the pools.
using Seed = std::vector<PointMatch>;

/// Returns binom(m, k)^2 k! seeds: every way to match k of the first m points
/// of X's pool with k of Y's (pools begin with the basis points in order of
/// farthest point sampling). m is cut to the pools' sizes, and k to m.
///
/// Ordered by how well distances agree: the sum over a seed's pairs of |d_X -
/// d_Y| and over its points of the difference of their mean distance to the
/// whole shape. Ties keep the order of generation. With max_seeds only the
/// first that many; the order is not in the paper.
///
/// REQUIRES: both meshes have the same area, m <= number of basis points.
std::vector<Seed> GenerateSeeds(const PointPool& pool_x,
                                const PointPool& pool_y,
                                const SeedOptions& options);

}  // namespace isomatch
