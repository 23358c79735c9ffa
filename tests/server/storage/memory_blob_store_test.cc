#include "server/storage/memory_blob_store.h"

#include <random>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/storage/sha256.h"
#include "tests/support/matchers.h"

namespace isomatch {
namespace {

using testing::_;

/// Stores `size` bytes of `fill` and returns their key.
std::string Put(MemoryBlobStore& store, char fill, size_t size, Keep keep) {
  std::string bytes(size, fill);
  const std::string key = Sha256Hex(bytes);
  EXPECT_THAT(store.Put(key, std::move(bytes), keep), IsOk());
  return key;
}

TEST(MemoryBlobStoreTest, GivesBackWhatWasPut) {
  MemoryBlobStore store(100);
  const std::string key = Put(store, 'a', 10, Keep::kWhileRoom);
  EXPECT_EQ(*store.Get(key), "aaaaaaaaaa");
  EXPECT_EQ(store.Get(Sha256Hex("b")), nullptr);
}

TEST(MemoryBlobStoreTest, TheLeastRecentlyUsedGoesFirst) {
  MemoryBlobStore store(100);
  const std::string a = Put(store, 'a', 40, Keep::kWhileRoom);
  const std::string b = Put(store, 'b', 40, Keep::kWhileRoom);
  EXPECT_NE(store.Get(a), nullptr);  // now b is the older one
  Put(store, 'c', 40, Keep::kWhileRoom);
  EXPECT_NE(store.Get(a), nullptr);
  EXPECT_EQ(store.Get(b), nullptr);
}

TEST(MemoryBlobStoreTest, WhatIsPinnedOrHeldStays) {
  MemoryBlobStore store(100);
  const std::string pinned = Put(store, 'a', 40, Keep::kPinned);
  const std::string read = Put(store, 'b', 40, Keep::kWhileRoom);
  BlobStore::Blob held = store.Get(read);
  const std::string big(40, 'c');
  EXPECT_THAT(store.Put(Sha256Hex(big), big, Keep::kWhileRoom),
              StatusIs(absl::StatusCode::kResourceExhausted, _));
  held.reset();
  EXPECT_THAT(store.Put(Sha256Hex(big), big, Keep::kWhileRoom), IsOk());
  EXPECT_NE(store.Get(pinned), nullptr);
}

TEST(MemoryBlobStoreTest, PinsOfTheSameContentAreCounted) {
  MemoryBlobStore store(100);
  const std::string key = Put(store, 'a', 60, Keep::kPinned);
  Put(store, 'a', 60, Keep::kPinned);
  store.Unpin(key);
  const std::string big(60, 'b');
  EXPECT_FALSE(store.Put(Sha256Hex(big), big, Keep::kWhileRoom).ok());
  store.Unpin(key);
  EXPECT_TRUE(store.Put(Sha256Hex(big), big, Keep::kWhileRoom).ok());
}

TEST(MemoryBlobStoreTest, NeverHoldsMoreThanItsCapacity) {
  constexpr int kSteps = 2000;
  MemoryBlobStore store(1000);
  std::mt19937 random(7);
  std::vector<std::string> pinned;
  for (int step = 0; step < kSteps; ++step) {
    SCOPED_TRACE(step);
    const std::string bytes(random() % 300, static_cast<char>(random() % 50));
    const std::string key = Sha256Hex(bytes);
    const Keep keep = random() % 4 == 0 ? Keep::kPinned : Keep::kWhileRoom;
    if (store.Put(key, bytes, keep).ok()) {
      EXPECT_EQ(*store.Get(key), bytes);
      if (keep == Keep::kPinned) pinned.push_back(key);
    }
    if (!pinned.empty() && random() % 3 == 0) {
      store.Unpin(pinned.back());
      pinned.pop_back();
    }
    for (const std::string& p : pinned) EXPECT_NE(store.Get(p), nullptr);
    ASSERT_LE(store.size_bytes(), 1000);
  }
}

}  // namespace
}  // namespace isomatch
