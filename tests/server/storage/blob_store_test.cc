#include "tests/server/storage/blob_store_conformance.h"

#include <cstdint>
#include <memory>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/sha256.h"
#include "server/storage/directory_blob_store.h"
#include "server/storage/memory_blob_store.h"
#include "tests/support/matchers.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

/// Stores of one process, in which pins say what is needed.
class PinningHarness {
 public:
  static constexpr int kRandomSteps = 1000;

  static void Hold(BlobStore& store, const BlobKey& key) {
    EXPECT_TRUE(store.Pin(key));
  }
  static void Release(BlobStore& store, const BlobKey& key) {
    store.Unpin(key);
  }
};

class MemoryHarness : public PinningHarness {
 public:
  static std::unique_ptr<BlobStore> Make(std::int64_t capacity_bytes) {
    return std::make_unique<MemoryBlobStore>(capacity_bytes);
  }
  static std::unique_ptr<BlobStore> MakeKeeping(std::int64_t capacity_bytes) {
    return Make(capacity_bytes);
  }
};

class DirectoryHarness : public PinningHarness {
 public:
  std::unique_ptr<BlobStore> Make(std::int64_t capacity_bytes) {
    auto store =
        DirectoryBlobStore::Open(folder_.Path("blobs"), capacity_bytes);
    EXPECT_THAT(store, IsOk());
    return *std::move(store);
  }
  std::unique_ptr<BlobStore> MakeKeeping(std::int64_t capacity_bytes) {
    return Make(capacity_bytes);
  }

 private:
  TemporaryFolder folder_;
};

using Harnesses = testing::Types<MemoryHarness, DirectoryHarness>;
INSTANTIATE_TYPED_TEST_SUITE_P(OneProcess, BlobStoreConformance, Harnesses);

template <typename Harness>
class CountedPinsTest : public testing::Test {
 protected:
  static BlobKey PutPinned(BlobStore& store, char fill) {
    const std::string bytes(60, fill);
    BlobKey key = {"tenant", Sha256Hex(bytes)};
    EXPECT_THAT(store.Put(key, bytes, Keep::kPinned), IsOk());
    return key;
  }

  Harness harness_;
};

TYPED_TEST_SUITE(CountedPinsTest, Harnesses);

TYPED_TEST(CountedPinsTest, PinsOfTheSameContentAreCounted) {
  const auto owner = this->harness_.Make(100);
  BlobStore& store = *owner;
  const BlobKey key = this->PutPinned(store, 'a');
  this->PutPinned(store, 'a');
  store.Unpin(key);
  const std::string big(60, 'b');
  const BlobKey other = {"tenant", Sha256Hex(big)};
  EXPECT_FALSE(store.Put(other, big, Keep::kWhileRoom).ok());
  store.Unpin(key);
  EXPECT_TRUE(store.Put(other, big, Keep::kWhileRoom).ok());
}

}  // namespace
}  // namespace isomatch
