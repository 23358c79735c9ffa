#include <atomic>
#include <cstdint>
#include <memory>
#include <random>
#include <string>
#include <thread>
#include <type_traits>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/sha256.h"
#include "server/storage/directory_blob_store.h"
#include "server/storage/memory_blob_store.h"
#include "tests/support/matchers.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

using testing::_;

auto IsMissing() { return StatusIs(absl::StatusCode::kNotFound, _); }

/// What holds for every store, of which Make gives an empty one.
template <typename Store>
class BlobStoreTest : public testing::Test {
 protected:
  std::unique_ptr<BlobStore> Make(std::int64_t capacity_bytes) {
    if constexpr (std::is_same_v<Store, MemoryBlobStore>) {
      return std::make_unique<MemoryBlobStore>(capacity_bytes);
    } else {
      auto store =
          DirectoryBlobStore::Open(folder_.Path("blobs"), capacity_bytes);
      EXPECT_THAT(store, IsOk());
      return *std::move(store);
    }
  }

  /// Stores `size` bytes of `fill` and returns their key.
  static BlobKey Put(BlobStore& store, char fill, size_t size, Keep keep) {
    std::string bytes(size, fill);
    const BlobKey key = KeyOf(bytes);
    EXPECT_THAT(store.Put(key, std::move(bytes), keep), IsOk());
    return key;
  }

  static BlobKey KeyOf(const std::string& bytes) {
    return {"tenant", Sha256Hex(bytes)};
  }

  TemporaryFolder folder_;
};

using Stores = testing::Types<MemoryBlobStore, DirectoryBlobStore>;
TYPED_TEST_SUITE(BlobStoreTest, Stores);

TYPED_TEST(BlobStoreTest, GivesBackWhatWasPut) {
  const auto owner = this->Make(100);
  BlobStore& store = *owner;
  const BlobKey key = this->Put(store, 'a', 10, Keep::kWhileRoom);
  EXPECT_EQ(**store.Get(key), "aaaaaaaaaa");
  EXPECT_THAT(store.Get(this->KeyOf("b")), IsMissing());
}

TYPED_TEST(BlobStoreTest, TheLeastRecentlyUsedGoesFirst) {
  const auto owner = this->Make(100);
  BlobStore& store = *owner;
  const BlobKey a = this->Put(store, 'a', 40, Keep::kWhileRoom);
  const BlobKey b = this->Put(store, 'b', 40, Keep::kWhileRoom);
  EXPECT_THAT(store.Get(a), IsOk());  // now b is the older one
  this->Put(store, 'c', 40, Keep::kWhileRoom);
  EXPECT_THAT(store.Get(a), IsOk());
  EXPECT_THAT(store.Get(b), IsMissing());
}

TYPED_TEST(BlobStoreTest, WhatIsPinnedStays) {
  const auto owner = this->Make(100);
  BlobStore& store = *owner;
  const BlobKey pinned = this->Put(store, 'a', 40, Keep::kPinned);
  const BlobKey later = this->Put(store, 'b', 40, Keep::kWhileRoom);
  EXPECT_TRUE(store.Pin(later));
  EXPECT_FALSE(store.Pin(this->KeyOf("nothing")));
  const std::string big(40, 'c');
  EXPECT_THAT(store.Put(this->KeyOf(big), big, Keep::kWhileRoom),
              StatusIs(absl::StatusCode::kResourceExhausted, _));
  store.Unpin(later);
  EXPECT_THAT(store.Put(this->KeyOf(big), big, Keep::kWhileRoom), IsOk());
  EXPECT_THAT(store.Get(pinned), IsOk());
  EXPECT_FALSE(store.Has(later));
  EXPECT_EQ(store.size_bytes(), 80);
}

TYPED_TEST(BlobStoreTest, ATenantsOwnUnusedBlobsMakeItsRoom) {
  const auto owner = this->Make(1000);
  BlobStore& store = *owner;
  const BlobKey pinned = this->Put(store, 'a', 40, Keep::kPinned);
  const BlobKey older = this->Put(store, 'b', 20, Keep::kWhileRoom);
  const BlobKey newer = this->Put(store, 'c', 20, Keep::kWhileRoom);
  const std::string foreign(300, 'd');
  const BlobKey other = {"other", Sha256Hex(foreign)};
  ASSERT_THAT(store.Put(other, foreign, Keep::kWhileRoom), IsOk());
  const BlobKey next = this->KeyOf("next");
  EXPECT_TRUE(store.MakeTenantRoom(next, 20, 100));
  EXPECT_TRUE(store.MakeTenantRoom(pinned, 40, 80));  // takes its room already
  EXPECT_EQ(store.size_bytes(), 380);
  EXPECT_TRUE(store.MakeTenantRoom(next, 40, 100));
  EXPECT_FALSE(store.Has(older));
  EXPECT_TRUE(store.Has(newer));
  EXPECT_FALSE(store.MakeTenantRoom(next, 61, 100));
  EXPECT_TRUE(store.Has(newer));
  EXPECT_TRUE(store.Has(pinned));
  EXPECT_TRUE(store.Has(other));
  EXPECT_EQ(store.size_bytes(), 360);
}

TYPED_TEST(BlobStoreTest, WhatArrivesTogetherKeepsToTheTenantsLimitTogether) {
  constexpr int kThreads = 8;
  const auto owner = this->Make(10000);
  BlobStore& store = *owner;
  std::atomic<int> put = 0;
  std::atomic<int> refused = 0;
  {
    std::vector<std::jthread> threads;
    for (int i = 0; i < kThreads; ++i) {
      threads.emplace_back([&, i] {
        const std::string bytes(100, static_cast<char>('a' + i));
        const absl::Status status =
            store.PutWithin(300, this->KeyOf(bytes), bytes, Keep::kPinned);
        (status.ok() ? put : refused)++;
        EXPECT_TRUE(status.ok() || absl::IsFailedPrecondition(status));
      });
    }
  }
  EXPECT_EQ(put, 3);
  EXPECT_EQ(refused, kThreads - 3);
  EXPECT_EQ(store.size_bytes(), 300);
}

TYPED_TEST(BlobStoreTest, WhatACallerHoldsStaysWhole) {
  const auto owner = this->Make(100);
  BlobStore& store = *owner;
  const BlobKey read = this->Put(store, 'b', 60, Keep::kWhileRoom);
  const BlobStore::Blob held = *store.Get(read);
  const std::string big(60, 'c');
  (void)store.Put(this->KeyOf(big), big, Keep::kWhileRoom);
  EXPECT_EQ(*held, std::string(60, 'b'));
}

TYPED_TEST(BlobStoreTest, TenantsShareNothing) {
  const auto owner = this->Make(100);
  BlobStore& store = *owner;
  const BlobKey mine = this->Put(store, 'a', 10, Keep::kWhileRoom);
  const BlobKey other = {"other", mine.sha256};
  EXPECT_TRUE(store.Has(mine));
  EXPECT_FALSE(store.Has(other));
  EXPECT_THAT(store.Get(other), IsMissing());
  EXPECT_FALSE(store.Pin(other));
}

TYPED_TEST(BlobStoreTest, PinsOfTheSameContentAreCounted) {
  const auto owner = this->Make(100);
  BlobStore& store = *owner;
  const BlobKey key = this->Put(store, 'a', 60, Keep::kPinned);
  this->Put(store, 'a', 60, Keep::kPinned);
  store.Unpin(key);
  const std::string big(60, 'b');
  EXPECT_FALSE(store.Put(this->KeyOf(big), big, Keep::kWhileRoom).ok());
  store.Unpin(key);
  EXPECT_TRUE(store.Put(this->KeyOf(big), big, Keep::kWhileRoom).ok());
}

TYPED_TEST(BlobStoreTest, TheRoomThatCanBeMadeIsWhatIsNotNeeded) {
  const auto owner = this->Make(100);
  BlobStore& store = *owner;
  this->Put(store, 'a', 30, Keep::kWhileRoom);
  const BlobKey pinned = this->Put(store, 'b', 40, Keep::kPinned);
  EXPECT_TRUE(store.CanMakeRoom(60));
  EXPECT_FALSE(store.CanMakeRoom(61));
  store.Unpin(pinned);
  EXPECT_TRUE(store.CanMakeRoom(100));
  EXPECT_EQ(store.size_bytes(), 70);
  EXPECT_THAT(store.TryWriting(1000), IsOk());
}

TYPED_TEST(BlobStoreTest, WhatIsThereIsWhole) {
  const auto owner = this->Make(100);
  BlobStore& store = *owner;
  const BlobKey key = this->Put(store, 'a', 10, Keep::kWhileRoom);
  EXPECT_TRUE(store.HasWhole(key));
  EXPECT_FALSE(store.HasWhole(this->KeyOf("b")));
  store.Remove(key);
  EXPECT_FALSE(store.HasWhole(key));
}

TYPED_TEST(BlobStoreTest, NeverHoldsMoreThanItsCapacity) {
  constexpr int kSteps = 1000;
  const auto owner = this->Make(1000);
  BlobStore& store = *owner;
  std::mt19937 random(7);
  std::vector<BlobKey> pinned;
  for (int step = 0; step < kSteps; ++step) {
    SCOPED_TRACE(step);
    const std::string bytes(random() % 300, static_cast<char>(random() % 50));
    const BlobKey key = this->KeyOf(bytes);
    const Keep keep = random() % 4 == 0 ? Keep::kPinned : Keep::kWhileRoom;
    if (store.Put(key, bytes, keep).ok()) {
      EXPECT_EQ(**store.Get(key), bytes);
      if (keep == Keep::kPinned) pinned.push_back(key);
    }
    if (!pinned.empty() && random() % 3 == 0) {
      store.Unpin(pinned.back());
      pinned.pop_back();
    }
    for (const BlobKey& p : pinned) EXPECT_THAT(store.Get(p), IsOk());
    ASSERT_LE(store.size_bytes(), 1000);
  }
}

}  // namespace
}  // namespace isomatch
