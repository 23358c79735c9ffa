#include "core/matching/annealing.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

namespace isomatch {
namespace {

/// Changes below this are rounding of single-precision sums, no improvement.
constexpr double kRounding = 1e-5;

/// The `count` unmatched points of Y closest to the image of match i, in
/// decreasing order of closeness.
void UnmatchedNear(const Matching& matching, int i, int count,
                   std::vector<int>* found) {
  const PointPool& pool = matching.pool(kY);
  const int image = matching.point(kY, i);
  std::vector<int>& near = *found;
  const auto take = [&](absl::Span<const int> points) {
    near.clear();
    for (const int y : points) {
      if (static_cast<int>(near.size()) == count) return;
      if (!matching.is_matched(kY, y)) near.push_back(y);
    }
  };
  take(pool.Nearest(image));
  // No table, or a crowd of matches around. Only matched points are passed
  // over.
  if (static_cast<int>(near.size()) < count) {
    take(ClosestOf(matching.Row(kY, i), pool.size(), image,
                   count + matching.size()));
  }
}

/// A match other than i to swap with. REQUIRES: at least two matches.
int DrawPartner(const Matching& matching, int neighbors, int i,
                RandomStream* random) {
  if (neighbors > 0) {
    const auto near = matching.NearestOnX(i);
    return near[random->Below(static_cast<int>(near.size()))];
  }
  const int j = random->Below(matching.size() - 1);
  return j < i ? j : j + 1;
}

/// Whether `drawn` of [0, 1) is below e^-x.
bool IsAccepted(double x, double drawn) {
  // e^x is above the first terms of its series, which are quicker.
  constexpr double kAbove = 1 + 1e-9;
  if (x > 0 && drawn * (1 + x * (1 + x / 2)) > kAbove) return false;
  return drawn < std::exp(-x);
}

}  // namespace

int SwapPhase(const SwapOptions& options, double temperature,
              RandomStream* random, Matching* matching) {
  if (matching->size() < 2) return 0;
  int accepted = 0;
  if (options.neighbors > 0) matching->ListNearestOnX(options.neighbors);
  for (int proposed = 0; proposed < options.proposals; ++proposed) {
    const int i = random->Below(matching->size());
    const int j = DrawPartner(*matching, options.neighbors, i, random);
    if (std::min(i, j) < matching->pinned()) continue;
    const double change = matching->SwapChange(i, j);
    if (!(change < -kRounding)) {
      if (temperature == 0) continue;
      if (!IsAccepted(change / temperature, random->Unit())) continue;
    }
    matching->Swap(i, j);
    ++accepted;
  }
  return accepted;
}

int RelocationSweep(int neighbors, Matching* matching) {
  int moves = 0;
  std::vector<float> changes;
  std::vector<int> targets;
  for (int i = matching->pinned(); i < matching->size(); ++i) {
    UnmatchedNear(*matching, i, neighbors, &targets);
    matching->RelocateChanges(i, targets, &changes);
    int best = -1;
    double least = -kRounding;
    for (std::size_t t = 0; t < targets.size(); ++t) {
      if (changes[t] >= least) continue;
      least = changes[t];
      best = targets[t];
    }
    if (best < 0) continue;
    matching->Relocate(i, best);
    ++moves;
  }
  return moves;
}

}  // namespace isomatch
