#include "core/matching/witnesses.h"

#include <algorithm>
#include <array>
#include <cstddef>

#include "core/base/lanes.h"

namespace isomatch {
namespace {

Lanes CostsOf(const Witness& witness, const int* places) {
  const Lanes off =
      AbsLanes(GatherLanes(witness.distances_y, places) - witness.distance);
  return witness.weight *
         MinLanes(AllLanes(1), off * witness.inverse_tolerance);
}

}  // namespace

PlaceFound CheapestPlace(absl::Span<const int> places, const float* place_costs,
                         float place_weight,
                         absl::Span<const Witness> witnesses, float most) {
  PlaceFound best = {-1, most};
  for (std::size_t i = 0; i < places.size(); i += kLanes) {
    const std::size_t count = std::min<std::size_t>(kLanes, places.size() - i);
    std::array<int, kLanes> ys;
    ys.fill(places[i]);
    std::copy_n(places.begin() + i, count, ys.begin());
    Lanes costs = place_weight * GatherLanes(place_costs, ys.data());
    for (const Witness& witness : witnesses) {
      if (!AnyLane(costs < AllLanes(best.cost))) break;
      costs += CostsOf(witness, ys.data());
    }
    for (std::size_t k = 0; k < count; ++k) {
      if (costs[k] < best.cost) best = {ys[k], costs[k]};
    }
  }
  return best;
}

}  // namespace isomatch
