#pragma once

#include <algorithm>
#include <cstddef>

namespace isomatch {

/// The few of some items that are closest, closest first; ties in the order in
/// which they were offered. The arrays must outlive it.
struct NearestList {
  int* items;
  float* closeness;
  std::size_t capacity;  ///< at least 1

  /// Takes an item beside `size` others that were offered, of which the list
  /// holds as many as it can; leaves it out where those are as close.
  void Offer(std::size_t size, int item, float value) const {
    std::size_t at = std::min(size, capacity - 1);
    if (size >= capacity && !(value > closeness[at])) return;
    for (; at > 0 && closeness[at - 1] < value; --at) {
      items[at] = items[at - 1];
      closeness[at] = closeness[at - 1];
    }
    items[at] = item;
    closeness[at] = value;
  }
};

}  // namespace isomatch
