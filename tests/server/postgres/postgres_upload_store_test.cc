#include "server/postgres/postgres_upload_store.h"

#include <memory>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/postgres/chunk_rows.h"
#include "server/postgres/postgres_pool.h"
#include "tests/server/postgres/blob_database.h"
#include "tests/support/matchers.h"

namespace isomatch {
namespace {

using testing::_;
using testing::AnyOf;
using testing::ElementsAre;

class PostgresUploadStoreTest : public testing::Test {
 protected:
  static constexpr UploadStore::Limits kLimits = {.total_bytes = 100,
                                                  .tenant_bytes = 50};

  static BlobKey Key(const std::string& sha256,
                     const std::string& tenant = "tenant") {
    return {tenant, sha256};
  }

  void Keep(const BlobKey& key, const std::string& bytes) {
    EXPECT_THAT(store_.Keep(key, bytes, kLimits), IsOk());
  }

  std::size_t Kept(const BlobKey& key) {
    return store_.ReceivedBytes(key.tenant, {key.sha256})->front();
  }

  void Age(int seconds) {
    database_.Do(
        "UPDATE isomatch.partial_uploads SET kept_at = kept_at - "
        "interval '" +
        std::to_string(seconds) + " s'");
  }

  BlobDatabase database_;
  PostgresUploadStore store_{database_.pool(), {.max_kept = 3}};
};

TEST_F(PostgresUploadStoreTest, WhatOneProcessKeepsAnotherGoesOnWith) {
  std::string bytes(10 * 1024 * 1024 + 1, '\0');
  for (size_t i = 0; i < bytes.size(); ++i) {
    bytes[i] = static_cast<char>(i * i / 1000);
  }
  EXPECT_THAT(store_.Keep(Key("a"), bytes,
                          {.total_bytes = 1 << 30, .tenant_bytes = 1 << 30}),
              IsOk());
  const auto pool = database_.OpenPool();
  PostgresUploadStore other(pool.get(), {});
  EXPECT_THAT(*other.ReceivedBytes("tenant", {"b", "a", "c", "a"}),
              ElementsAre(0, bytes.size(), 0, bytes.size()));
  EXPECT_THAT(*other.ReceivedBytes("other", {"a"}), ElementsAre(0));
  EXPECT_EQ(*other.Read(Key("a", "other")), "");
  EXPECT_TRUE(*other.Read(Key("a")) == bytes);
  EXPECT_TRUE(*store_.Read(Key("a")) == bytes);
  other.Forget(Key("a"));
  EXPECT_EQ(*store_.Read(Key("a")), "");
  EXPECT_EQ(Kept(Key("a")), 0);
  EXPECT_EQ(database_.Do("SELECT count(*) FROM isomatch.partial_chunks"), "0");
}

TEST_F(PostgresUploadStoreTest, WhatIsThereIsNotWrittenAgain) {
  constexpr UploadStore::Limits kMuch = {.total_bytes = 1 << 30,
                                         .tenant_bytes = 1 << 30};
  std::string bytes;
  const auto keep = [&](std::size_t size) {
    while (bytes.size() < size) {
      bytes += static_cast<char>(bytes.size() * bytes.size() / 1000);
    }
    EXPECT_THAT(store_.Keep(Key("a"), bytes, kMuch), IsOk());
    EXPECT_TRUE(*store_.Read(Key("a")) == bytes);
  };
  const auto first_written = [&] {
    return database_.Do(
        "SELECT min(index) FROM isomatch.partial_chunks WHERE xmin = "
        "(SELECT xmin FROM isomatch.partial_uploads)");
  };
  keep(1'000'000);
  EXPECT_EQ(first_written(), "0");
  keep(1'000'001);  // in the same row
  EXPECT_EQ(first_written(), "3");
  keep(4 * kChunkBytes);
  EXPECT_EQ(first_written(), "3");
  keep(4 * kChunkBytes + 1);
  EXPECT_EQ(first_written(), "4");
  const std::string xmin =
      database_.Do("SELECT xmin FROM isomatch.partial_uploads");
  keep(4 * kChunkBytes + 1);  // nothing more came
  EXPECT_EQ(database_.Do("SELECT xmin FROM isomatch.partial_uploads"), xmin);
}

TEST_F(PostgresUploadStoreTest, ManyAtOnceDoNotWaitInACircle) {
  std::vector<std::jthread> threads;
  for (int t = 0; t < 6; ++t) {
    threads.emplace_back([this, t] {
      const auto pool = database_.OpenPool();
      PostgresUploadStore store(pool.get(), {.max_kept = 2});
      for (int i = 0; i < 60; ++i) {
        const BlobKey key =
            Key(std::string(1, static_cast<char>('a' + (i * 5 + t) % 4)));
        EXPECT_THAT(store.Keep(key, std::string(10 + i / 4, 'x'), kLimits),
                    IsOk());
      }
    });
  }
  threads.clear();
  // Each trimmed what it could see.
  EXPECT_THAT(store_.Keep(Key("last"), "0123", kLimits), IsOk());
  EXPECT_LE(
      std::stoi(database_.Do("SELECT count(*) FROM isomatch.partial_uploads")),
      3);
}

TEST_F(PostgresUploadStoreTest, OfTwoUploadsTheLongerIsKept) {
  Keep(Key("a"), "0123");
  Keep(Key("a"), "012345");
  Keep(Key("a"), "01");
  EXPECT_EQ(*store_.Read(Key("a")), "012345");
}

TEST_F(PostgresUploadStoreTest, ExpiresAfterItsTime) {
  Keep(Key("a"), "0123");
  Keep(Key("b"), "0123");
  Age(299);
  EXPECT_EQ(Kept(Key("a")), 4);
  Age(2);
  EXPECT_EQ(Kept(Key("a")), 0);
  EXPECT_EQ(*store_.Read(Key("a")), "");
  Keep(Key("a"), "01");  // what is over does not count as longer
  store_.Tidy();
  EXPECT_EQ(Kept(Key("a")), 2);
  EXPECT_EQ(database_.Do("SELECT count(*) FROM isomatch.partial_uploads"), "1");
}

TEST_F(PostgresUploadStoreTest, ATenantHasItsShareAndLosesItsOldest) {
  Keep(Key("other", "other"), std::string(40, 'o'));
  Keep(Key("a"), std::string(30, 'a'));
  Keep(Key("b"), std::string(30, 'b'));
  EXPECT_EQ(Kept(Key("a")), 0);
  EXPECT_EQ(Kept(Key("b")), 30);
  Keep(Key("c"), std::string(51, 'c'));  // more than it may have
  EXPECT_EQ(Kept(Key("c")), 0);
  EXPECT_EQ(Kept(Key("other", "other")), 40);
}

TEST_F(PostgresUploadStoreTest, WhoHasMostGivesWayToAll) {
  Keep(Key("a", "one"), std::string(50, 'a'));
  Keep(Key("a", "two"), std::string(40, 'a'));
  Keep(Key("a", "three"), std::string(20, 'a'));
  EXPECT_EQ(Kept(Key("a", "one")), 0);
  EXPECT_EQ(Kept(Key("a", "two")), 40);
  EXPECT_EQ(Kept(Key("a", "three")), 20);
}

TEST_F(PostgresUploadStoreTest, TheirNumberIsBounded) {
  Keep(Key("a", "other"), "0");
  for (const char* sha256 : {"a", "b", "c"}) Keep(Key(sha256), "0");
  EXPECT_EQ(Kept(Key("a", "other")), 1);
  EXPECT_EQ(Kept(Key("a")), 0);
  EXPECT_EQ(Kept(Key("b")), 1);
}

TEST_F(PostgresUploadStoreTest, OfTwoThatGoOnWithItTheLongerIsKept) {
  for (int round = 0; round < 20; ++round) {
    Keep(Key("a"), "0123");
    {
      std::vector<std::jthread> threads;
      for (const std::string more : {"4", "45678"}) {
        threads.emplace_back(
            [this, more] { Keep(Key("a"), *store_.Read(Key("a")) + more); });
      }
    }
    // If one has read what the other kept already, both have added to it.
    EXPECT_THAT(*store_.Read(Key("a")),
                AnyOf("012345678", "0123445678", "0123456784"));
    store_.Forget(Key("a"));
  }
}

TEST_F(PostgresUploadStoreTest, ADatabaseThatIsAwayIsUnavailable) {
  Keep(Key("a"), "0123");
  database_.server().Kill();
  const auto is_unavailable = StatusIs(absl::StatusCode::kUnavailable, _);
  EXPECT_THAT(store_.Keep(Key("b"), "0", kLimits), is_unavailable);
  EXPECT_THAT(store_.Read(Key("a")), is_unavailable);
  EXPECT_THAT(store_.ReceivedBytes("tenant", {"a"}), is_unavailable);
  ASSERT_THAT(database_.server().Restart(), IsOk());
  EXPECT_EQ(*store_.Read(Key("a")), "0123");
}

}  // namespace
}  // namespace isomatch
