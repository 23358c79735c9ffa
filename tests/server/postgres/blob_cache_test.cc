#include "server/postgres/blob_cache.h"

#include <memory>
#include <string>

#include <gtest/gtest.h>

namespace isomatch {
namespace {

BlobCache::Entry EntryOf(const std::string& name, size_t size) {
  return {{"tenant", name}, std::make_shared<const std::string>(size, 'x'), {}};
}

TEST(BlobCacheTest, KeepsTheMostRecentlyUsedWithinItsBytes) {
  BlobCache cache(100);
  cache.Put(EntryOf("a", 40));
  cache.Put(EntryOf("b", 40));
  EXPECT_TRUE(cache.Find({"tenant", "a"}));  // now b is the older one
  cache.Put(EntryOf("c", 40));
  EXPECT_TRUE(cache.Find({"tenant", "a"}));
  EXPECT_FALSE(cache.Find({"tenant", "b"}));
  EXPECT_TRUE(cache.Find({"tenant", "c"}));
  EXPECT_FALSE(cache.Find({"other", "a"}));
}

TEST(BlobCacheTest, WhatIsLargerThanTheCacheIsNotKept) {
  BlobCache cache(100);
  cache.Put(EntryOf("a", 40));
  cache.Put(EntryOf("b", 101));
  EXPECT_TRUE(cache.Find({"tenant", "a"}));
  EXPECT_FALSE(cache.Find({"tenant", "b"}));
}

TEST(BlobCacheTest, OneThatIsPutAgainCountsOnce) {
  BlobCache cache(100);
  for (int i = 0; i < 5; ++i) cache.Put(EntryOf("a", 40));
  cache.Put(EntryOf("b", 60));
  EXPECT_TRUE(cache.Find({"tenant", "a"}));
  BlobCache::Entry again = EntryOf("a", 40);
  again.known_at += std::chrono::seconds(7);
  cache.Put(again);
  EXPECT_EQ(cache.Find({"tenant", "a"})->known_at, again.known_at);
}

TEST(BlobCacheTest, WhatIsRemovedLeavesItsRoom) {
  BlobCache cache(100);
  cache.Put(EntryOf("a", 60));
  cache.Remove({"tenant", "a"});
  cache.Remove({"tenant", "a"});
  EXPECT_FALSE(cache.Find({"tenant", "a"}));
  cache.Put(EntryOf("b", 50));
  cache.Put(EntryOf("c", 50));
  EXPECT_TRUE(cache.Find({"tenant", "b"}));
}

}  // namespace
}  // namespace isomatch
