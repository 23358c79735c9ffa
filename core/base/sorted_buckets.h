#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <vector>

#include "absl/types/span.h"

namespace isomatch {

/// Items in buckets by a small number, such as their smallest vertex, and
/// sorted in each. Where buckets hold a few items each this takes time O(n),
/// about a fifth of sorting them all at once.
template <typename Item>
class SortedBuckets {
 public:
  /// Item i of `count` is item(i), in bucket bucket_of(i) of `num_buckets`.
  template <typename BucketOf, typename MakeItem>
  SortedBuckets(std::int64_t count, std::int64_t num_buckets,
                const BucketOf& bucket_of, const MakeItem& item)
      : items_(count), begin_(num_buckets + 1, 0) {
    for (std::int64_t i = 0; i < count; ++i) ++begin_[bucket_of(i)];
    // The end of each bucket; filling it from there leaves its beginning.
    std::partial_sum(begin_.begin(), begin_.end(), begin_.begin());
    for (std::int64_t i = count - 1; i >= 0; --i) {
      items_[--begin_[bucket_of(i)]] = item(i);
    }
    for (std::int64_t b = 0; b < num_buckets; ++b) {
      std::sort(items_.begin() + begin_[b], items_.begin() + begin_[b + 1]);
    }
  }

  std::int64_t count() const {
    return static_cast<std::int64_t>(begin_.size()) - 1;
  }
  /// Of all buckets, in order.
  const std::vector<Item>& items() const { return items_; }
  absl::Span<const Item> operator[](std::int64_t bucket) const {
    return absl::MakeConstSpan(items_).subspan(
        begin_[bucket], begin_[bucket + 1] - begin_[bucket]);
  }

 private:
  std::vector<Item> items_;
  std::vector<std::int64_t> begin_;
};

}  // namespace isomatch
