#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <random>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/sha256.h"
#include "server/storage/blob_store.h"
#include "tests/support/matchers.h"

namespace isomatch {

inline auto IsMissingBlob() {
  return StatusIs(absl::StatusCode::kNotFound, testing::_);
}

/// What holds for every store. A Harness has
///
///   std::unique_ptr<BlobStore> Make(std::int64_t capacity_bytes);
///   std::unique_ptr<BlobStore> MakeKeeping(std::int64_t capacity_bytes);
///   void Hold(BlobStore& store, const BlobKey& key);
///   void Release(BlobStore& store, const BlobKey& key);
///   static constexpr int kRandomSteps;
///
/// Make returns an empty store, in which only what is held stays; MakeKeeping
/// one in which also stays what was just put with kPinned. Hold and Release do
/// what the service does for a blob that a job needs.
template <typename Harness>
class BlobStoreConformance : public testing::Test {
 protected:
  /// Stores `size` bytes of `fill` and returns their key.
  static BlobKey Put(BlobStore& store, char fill, size_t size, Keep keep) {
    std::string bytes(size, fill);
    BlobKey key = KeyOf(bytes);
    EXPECT_THAT(store.Put(key, std::move(bytes), keep), IsOk());
    return key;
  }

  BlobKey PutHeld(BlobStore& store, char fill, size_t size) {
    BlobKey key = Put(store, fill, size, Keep::kWhileRoom);
    harness_.Hold(store, key);
    return key;
  }

  static BlobKey KeyOf(const std::string& bytes) {
    return {"tenant", Sha256Hex(bytes)};
  }

  Harness harness_;
};

TYPED_TEST_SUITE_P(BlobStoreConformance);

TYPED_TEST_P(BlobStoreConformance, GivesBackWhatWasPut) {
  const auto owner = this->harness_.Make(100);
  BlobStore& store = *owner;
  const BlobKey key = this->Put(store, 'a', 10, Keep::kWhileRoom);
  EXPECT_EQ(**store.Get(key), "aaaaaaaaaa");
  EXPECT_THAT(store.Get(this->KeyOf("b")), IsMissingBlob());
}

TYPED_TEST_P(BlobStoreConformance, TheLeastRecentlyUsedGoesFirst) {
  const auto owner = this->harness_.Make(100);
  BlobStore& store = *owner;
  const BlobKey a = this->Put(store, 'a', 40, Keep::kWhileRoom);
  const BlobKey b = this->Put(store, 'b', 40, Keep::kWhileRoom);
  EXPECT_THAT(store.Get(a), IsOk());  // now b is the older one
  this->Put(store, 'c', 40, Keep::kWhileRoom);
  EXPECT_THAT(store.Get(a), IsOk());
  EXPECT_THAT(store.Get(b), IsMissingBlob());
}

TYPED_TEST_P(BlobStoreConformance, WhatIsNeededStays) {
  const auto owner = this->harness_.Make(100);
  BlobStore& store = *owner;
  const BlobKey needed = this->PutHeld(store, 'a', 40);
  const BlobKey later = this->Put(store, 'b', 40, Keep::kWhileRoom);
  EXPECT_TRUE(store.Pin(later));
  EXPECT_FALSE(store.Pin(this->KeyOf("nothing")));
  this->harness_.Hold(store, later);
  store.Unpin(later);
  const std::string big(40, 'c');
  EXPECT_THAT(store.Put(this->KeyOf(big), big, Keep::kWhileRoom),
              StatusIs(absl::StatusCode::kResourceExhausted, testing::_));
  this->harness_.Release(store, later);
  EXPECT_THAT(store.Put(this->KeyOf(big), big, Keep::kWhileRoom), IsOk());
  EXPECT_THAT(store.Get(needed), IsOk());
  EXPECT_FALSE(store.Has(later));
  EXPECT_EQ(store.size_bytes(), 80);
}

TYPED_TEST_P(BlobStoreConformance, ATenantsOwnUnusedBlobsMakeItsRoom) {
  const auto owner = this->harness_.Make(1000);
  BlobStore& store = *owner;
  const std::string foreign(300, 'd');
  const BlobKey other = {"other", Sha256Hex(foreign)};
  ASSERT_THAT(store.Put(other, foreign, Keep::kWhileRoom), IsOk());
  const BlobKey needed = this->PutHeld(store, 'a', 40);
  const BlobKey older = this->Put(store, 'b', 20, Keep::kWhileRoom);
  const BlobKey newer = this->Put(store, 'c', 20, Keep::kWhileRoom);
  const BlobKey next = this->KeyOf("next");
  EXPECT_TRUE(store.MakeTenantRoom(next, 20, 100));
  EXPECT_TRUE(store.MakeTenantRoom(needed, 40, 80));  // takes its room already
  EXPECT_TRUE(store.MakeTenantRoom(needed, 40, 41));
  EXPECT_EQ(store.size_bytes(), 380);
  EXPECT_TRUE(store.MakeTenantRoom(next, 40, 100));
  EXPECT_FALSE(store.Has(older));
  EXPECT_TRUE(store.Has(newer));
  EXPECT_FALSE(store.MakeTenantRoom(next, 61, 100));
  EXPECT_TRUE(store.Has(newer));
  EXPECT_TRUE(store.Has(needed));
  EXPECT_TRUE(store.Has(other));
  EXPECT_EQ(store.size_bytes(), 360);
}

TYPED_TEST_P(BlobStoreConformance,
             WhatArrivesTogetherKeepsToTheTenantsLimitTogether) {
  constexpr int kThreads = 8;
  const auto owner = this->harness_.MakeKeeping(10000);
  BlobStore& store = *owner;
  std::atomic<int> put = 0;
  std::atomic<int> refused = 0;
  {
    std::vector<std::jthread> threads;
    threads.reserve(kThreads);
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

TYPED_TEST_P(BlobStoreConformance, WhatACallerHoldsStaysWhole) {
  const auto owner = this->harness_.Make(100);
  BlobStore& store = *owner;
  const BlobKey read = this->Put(store, 'b', 60, Keep::kWhileRoom);
  const BlobStore::Blob held = *store.Get(read);
  const std::string big(60, 'c');
  (void)store.Put(this->KeyOf(big), big, Keep::kWhileRoom);
  EXPECT_EQ(*held, std::string(60, 'b'));
}

TYPED_TEST_P(BlobStoreConformance, TenantsShareNothing) {
  const auto owner = this->harness_.Make(100);
  BlobStore& store = *owner;
  const BlobKey mine = this->Put(store, 'a', 10, Keep::kWhileRoom);
  const BlobKey other = {"other", mine.sha256};
  EXPECT_TRUE(store.Has(mine));
  EXPECT_THAT(*store.AreThere("other", {mine.sha256}),
              testing::ElementsAre(false));
  EXPECT_FALSE(store.Has(other));
  EXPECT_THAT(store.Get(other), IsMissingBlob());
  EXPECT_FALSE(store.Pin(other));
}

TYPED_TEST_P(BlobStoreConformance, ManyAreLookedForAtOnceAndUsed) {
  const auto owner = this->harness_.Make(100);
  BlobStore& store = *owner;
  const BlobKey a = this->Put(store, 'a', 40, Keep::kWhileRoom);
  const BlobKey b = this->Put(store, 'b', 40, Keep::kWhileRoom);
  const BlobKey none = this->KeyOf("none");
  EXPECT_THAT(*store.AreThere(a.tenant, {}), testing::IsEmpty());
  EXPECT_THAT(
      *store.AreThere(a.tenant, {none.sha256, a.sha256, none.sha256, a.sha256}),
      testing::ElementsAre(false, true, false, true));
  this->Put(store, 'c', 40, Keep::kWhileRoom);
  EXPECT_THAT(*store.AreThere(a.tenant, {b.sha256, a.sha256}),
              testing::ElementsAre(false, true));
}

TYPED_TEST_P(BlobStoreConformance, TheRoomThatCanBeMadeIsWhatIsNotNeeded) {
  const auto owner = this->harness_.Make(100);
  BlobStore& store = *owner;
  this->Put(store, 'a', 30, Keep::kWhileRoom);
  const BlobKey needed = this->PutHeld(store, 'b', 40);
  EXPECT_TRUE(store.CanMakeRoom(60));
  EXPECT_FALSE(store.CanMakeRoom(61));
  this->harness_.Release(store, needed);
  EXPECT_TRUE(store.CanMakeRoom(100));
  EXPECT_EQ(store.size_bytes(), 70);
  EXPECT_THAT(store.TryWriting(1000), IsOk());
}

TYPED_TEST_P(BlobStoreConformance, WhatIsThereIsWhole) {
  const auto owner = this->harness_.Make(100);
  BlobStore& store = *owner;
  const BlobKey key = this->Put(store, 'a', 10, Keep::kWhileRoom);
  EXPECT_TRUE(store.HasWhole(key));
  EXPECT_FALSE(store.HasWhole(this->KeyOf("b")));
  store.Remove(key);
  EXPECT_FALSE(store.HasWhole(key));
}

TYPED_TEST_P(BlobStoreConformance, NeverHoldsMoreThanItsCapacity) {
  const auto owner = this->harness_.Make(1000);
  BlobStore& store = *owner;
  std::mt19937 random(7);
  std::vector<BlobKey> needed;
  for (int step = 0; step < TypeParam::kRandomSteps; ++step) {
    SCOPED_TRACE(step);
    const std::string bytes(random() % 300, static_cast<char>(random() % 50));
    const BlobKey key = this->KeyOf(bytes);
    const bool is_needed = random() % 4 == 0;
    if (store.Put(key, bytes, Keep::kWhileRoom).ok()) {
      EXPECT_EQ(**store.Get(key), bytes);
      if (is_needed) this->harness_.Hold(store, key);
      if (is_needed) needed.push_back(key);
    }
    if (!needed.empty() && random() % 3 == 0) {
      this->harness_.Release(store, needed.back());
      needed.pop_back();
    }
    for (const BlobKey& one : needed) EXPECT_THAT(store.Get(one), IsOk());
    ASSERT_LE(store.size_bytes(), 1000);
  }
}

REGISTER_TYPED_TEST_SUITE_P(BlobStoreConformance, GivesBackWhatWasPut,
                            TheLeastRecentlyUsedGoesFirst, WhatIsNeededStays,
                            ATenantsOwnUnusedBlobsMakeItsRoom,
                            WhatArrivesTogetherKeepsToTheTenantsLimitTogether,
                            WhatACallerHoldsStaysWhole, TenantsShareNothing,
                            ManyAreLookedForAtOnceAndUsed,
                            TheRoomThatCanBeMadeIsWhatIsNotNeeded,
                            WhatIsThereIsWhole, NeverHoldsMoreThanItsCapacity);

}  // namespace isomatch
