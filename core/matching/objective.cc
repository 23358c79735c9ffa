#include "core/matching/objective.h"

namespace isomatch {
namespace {

double OrderedPairs(const Matching& matching) {
  return double{1} * matching.size() * (matching.size() - 1);
}

}  // namespace

double Objective(const Matching& matching) {
  if (matching.size() < 2) return 0;
  double sum = 0;
  for (int i = 0; i < matching.size(); ++i) {
    for (int j = 0; j < i; ++j) {
      sum += 2.0 * matching.closeness(kX, i, j) * matching.closeness(kY, i, j);
    }
  }
  return sum / OrderedPairs(matching);
}

double EmbeddingError(const Matching& matching) {
  if (matching.size() < 2) return 0;
  return matching.Energy() / OrderedPairs(matching);
}

}  // namespace isomatch
