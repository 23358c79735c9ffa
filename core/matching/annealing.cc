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
std::vector<int> UnmatchedNear(const Matching& matching, int i, int count) {
  const PointPool& pool = matching.pool(kY);
  const int image = matching.point(kY, i);
  std::vector<int> near;
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
  return near;
}

/// Draws swap partners.
class PartnerSource {
 public:
  PartnerSource(const Matching& matching, int neighbors)
      : size_(matching.size()) {
    if (neighbors == 0) return;
    std::vector<float> row(size_);
    for (int i = 0; i < size_; ++i) {
      for (int j = 0; j < size_; ++j) row[j] = matching.closeness(kX, i, j);
      near_.push_back(ClosestOf(row.data(), size_, i, neighbors));
    }
  }

  /// A match other than i. REQUIRES: at least two matches.
  int Draw(int i, RandomStream* random) const {
    if (!near_.empty()) return near_[i][random->Below(near_[i].size())];
    const int j = random->Below(size_ - 1);
    return j < i ? j : j + 1;
  }

 private:
  int size_;
  std::vector<std::vector<int>> near_;
};

}  // namespace

SwapCounts SwapPhase(const SwapOptions& options, double temperature,
                     RandomStream* random, Matching* matching) {
  SwapCounts counts;
  if (matching->size() < 2) return counts;
  const PartnerSource partners(*matching, options.neighbors);
  for (; counts.proposed < options.proposals; ++counts.proposed) {
    const int i = random->Below(matching->size());
    const int j = partners.Draw(i, random);
    if (std::min(i, j) < matching->pinned()) continue;
    const double change = matching->SwapChange(i, j);
    const bool accept =
        change < -kRounding ||
        (temperature > 0 && random->Unit() < std::exp(-change / temperature));
    if (!accept) continue;
    matching->Swap(i, j);
    ++counts.accepted;
  }
  return counts;
}

int RelocationSweep(int neighbors, Matching* matching) {
  int moves = 0;
  std::vector<float> changes;
  for (int i = matching->pinned(); i < matching->size(); ++i) {
    const std::vector<int> targets = UnmatchedNear(*matching, i, neighbors);
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
