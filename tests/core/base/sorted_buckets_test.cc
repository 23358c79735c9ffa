#include "core/base/sorted_buckets.h"

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/random_stream.h"

namespace isomatch {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

TEST(SortedBucketsTest, AreInOrderWhatSortingAllAtOnceGives) {
  constexpr int kCount = 1000;
  constexpr int kBuckets = 300;  // some stay empty
  RandomStream random(/*seed=*/1, 0);
  std::vector<std::pair<std::int64_t, int>> expected;
  for (int i = 0; i < kCount; ++i) {
    const std::int64_t bucket = random.Below(kBuckets);
    expected.emplace_back(bucket, random.Below(10));
  }
  const SortedBuckets<int> buckets(
      kCount, kBuckets, [&](std::int64_t i) { return expected[i].first; },
      [&](std::int64_t i) { return expected[i].second; });
  std::sort(expected.begin(), expected.end());
  std::vector<std::pair<std::int64_t, int>> found;
  ASSERT_EQ(buckets.count(), kBuckets);
  for (std::int64_t b = 0; b < buckets.count(); ++b) {
    for (const int item : buckets[b]) found.emplace_back(b, item);
  }
  EXPECT_EQ(found, expected);
}

TEST(SortedBucketsTest, MayBeEmpty) {
  const auto none = [](std::int64_t) { return 0; };
  EXPECT_EQ(SortedBuckets<int>(0, 0, none, none).count(), 0);
  EXPECT_THAT(SortedBuckets<int>(0, 2, none, none)[1], IsEmpty());
  EXPECT_THAT(SortedBuckets<int>(2, 1, none, none)[0], ElementsAre(0, 0));
}

}  // namespace
}  // namespace isomatch
