#pragma once

#include <algorithm>
#include <numeric>
#include <vector>

#include "core/base/vertex_index.h"

namespace isomatch {

/// Disjoint sets over 0..n-1; the root is the smallest member.
class DisjointSets {
 public:
  explicit DisjointSets(VertexIndex n) : parent_(static_cast<std::size_t>(n)) {
    std::iota(parent_.begin(), parent_.end(), 0);
  }

  VertexIndex Find(VertexIndex v) {
    while (parent_[v] != v) v = parent_[v] = parent_[parent_[v]];
    return v;
  }

  void Join(VertexIndex a, VertexIndex b) {
    if (parent_[a] == parent_[b]) return;
    const auto [low, high] = std::minmax({Find(a), Find(b)});
    parent_[high] = low;
  }

 private:
  std::vector<VertexIndex> parent_;
};

}  // namespace isomatch
