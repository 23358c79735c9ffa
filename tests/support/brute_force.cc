#include "tests/support/brute_force.h"

#include <cmath>

namespace isomatch {
namespace {

template <typename Term>
double SumOverPairs(const PointPool& pool_x, const PointPool& pool_y,
                    const std::vector<PointMatch>& matches, const Term& term) {
  double sum = 0;
  for (std::size_t i = 0; i < matches.size(); ++i) {
    for (std::size_t j = 0; j < matches.size(); ++j) {
      if (i == j) continue;
      sum += term(pool_x.closeness()(pool_x.vertex(matches[i].x),
                                     pool_x.vertex(matches[j].x)),
                  pool_y.closeness()(pool_y.vertex(matches[i].y),
                                     pool_y.vertex(matches[j].y)));
    }
  }
  return sum;
}

}  // namespace

double BruteForceEnergy(const PointPool& pool_x, const PointPool& pool_y,
                        const std::vector<PointMatch>& matches) {
  return SumOverPairs(pool_x, pool_y, matches,
                      [](double x, double y) { return std::abs(x - y); });
}

double BruteForceObjective(const PointPool& pool_x, const PointPool& pool_y,
                           const std::vector<PointMatch>& matches) {
  const double pairs = double{1} * matches.size() * (matches.size() - 1);
  return SumOverPairs(pool_x, pool_y, matches,
                      [](double x, double y) { return x * y; }) /
         pairs;
}

}  // namespace isomatch
