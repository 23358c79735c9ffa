#include "core/matching/seed_generator.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include <Eigen/Core>

namespace isomatch {
namespace {

/// Distances among the first m points of a pool, and their mean distances to
/// the whole shape.
struct SeedPoints {
  Eigen::ArrayXXf distances;
  Eigen::ArrayXf mean_distances;

  SeedPoints(const PointPool& pool, int m)
      : distances(m, m), mean_distances(m) {
    const BasisPoints& basis = pool.closeness().basis();
    for (int i = 0; i < m; ++i) {
      mean_distances[i] = basis.MeanDistance(i);
      for (int j = 0; j < m; ++j) {
        distances(i, j) = basis.Distance(pool.vertex(i), j);
      }
    }
  }
};

/// All k-subsets of 0..m-1 in lexicographic order.
std::vector<std::vector<int>> Subsets(int m, int k) {
  std::vector<std::vector<int>> subsets;
  std::vector<bool> chosen(m, false);
  std::fill(chosen.begin(), chosen.begin() + k, true);
  do {
    std::vector<int> subset;
    for (int i = 0; i < m; ++i) {
      if (chosen[i]) subset.push_back(i);
    }
    subsets.push_back(std::move(subset));
  } while (std::prev_permutation(chosen.begin(), chosen.end()));
  return subsets;
}

float Disagreement(const SeedPoints& x, const SeedPoints& y, const Seed& seed) {
  float sum = 0;
  for (std::size_t i = 0; i < seed.size(); ++i) {
    sum += std::abs(x.mean_distances[seed[i].x] - y.mean_distances[seed[i].y]);
    for (std::size_t j = 0; j < i; ++j) {
      sum += std::abs(x.distances(seed[i].x, seed[j].x) -
                      y.distances(seed[i].y, seed[j].y));
    }
  }
  return sum;
}

std::vector<Seed> AllSeeds(int m, int k) {
  std::vector<Seed> seeds;
  const std::vector<std::vector<int>> subsets = Subsets(m, k);
  for (const std::vector<int>& xs : subsets) {
    for (std::vector<int> ys : subsets) {
      do {
        Seed seed(k);
        for (int i = 0; i < k; ++i) seed[i] = {xs[i], ys[i]};
        seeds.push_back(std::move(seed));
      } while (std::next_permutation(ys.begin(), ys.end()));
    }
  }
  return seeds;
}

}  // namespace

std::vector<Seed> GenerateSeeds(const PointPool& pool_x,
                                const PointPool& pool_y,
                                const SeedOptions& options) {
  const int m = std::min({options.points, pool_x.size(), pool_y.size()});
  const int k = std::min(options.matches, m);
  const SeedPoints points_x(pool_x, m);
  const SeedPoints points_y(pool_y, m);
  std::vector<Seed> seeds = AllSeeds(m, k);
  std::vector<std::pair<float, std::size_t>> order;
  order.reserve(seeds.size());
  for (std::size_t i = 0; i < seeds.size(); ++i) {
    order.emplace_back(Disagreement(points_x, points_y, seeds[i]), i);
  }
  std::sort(order.begin(), order.end());
  if (options.max_seeds > 0 &&
      order.size() > static_cast<std::size_t>(options.max_seeds)) {
    order.resize(options.max_seeds);
  }
  std::vector<Seed> best;
  best.reserve(order.size());
  for (const auto& [disagreement, i] : order) {
    best.push_back(std::move(seeds[i]));
  }
  return best;
}

}  // namespace isomatch
