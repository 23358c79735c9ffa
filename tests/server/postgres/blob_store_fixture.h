#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"
#include "core/base/sha256.h"
#include "server/postgres/postgres_blob_store.h"
#include "tests/server/postgres/blob_database.h"
#include "tests/support/matchers.h"

namespace isomatch {

/// A PostgresBlobStore on tables of its own, and its database's time.
class PostgresBlobStoreTest : public testing::Test {
 protected:
  using Options = PostgresBlobStore::Options;

  static constexpr std::int64_t kMiB = 1024 * 1024;

  std::unique_ptr<PostgresBlobStore> Make(const Options& options) {
    return std::make_unique<PostgresBlobStore>(database_.pool(), options);
  }

  static BlobKey KeyOf(const std::string& bytes) {
    return {"tenant", Sha256Hex(bytes)};
  }

  static BlobKey Put(BlobStore& store, const std::string& bytes) {
    BlobKey key = KeyOf(bytes);
    EXPECT_THAT(store.Put(key, bytes, Keep::kWhileRoom), IsOk());
    return key;
  }

  /// Bytes of which no two pieces are the same.
  static std::string ManyBytes(std::int64_t size, std::uint32_t seed) {
    std::string bytes(static_cast<size_t>(size), '\0');
    for (char& byte : bytes) {
      seed = seed * 1664525 + 1013904223;
      byte = static_cast<char>(seed >> 24);
    }
    return bytes;
  }

  /// Lets so many seconds pass for all blobs.
  void Age(int seconds) {
    const std::string time = "interval '" + std::to_string(seconds) + " s'";
    database_.Do("UPDATE isomatch.blobs SET used_at = used_at - " + time +
                 ", remove_at = remove_at - " + time);
  }

  std::string UsedAt() {
    return database_.Do("SELECT used_at FROM isomatch.blobs");
  }

  BlobDatabase database_;
};

}  // namespace isomatch
