// When what Remove was called for goes.

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <pqxx/pqxx>

#include "absl/strings/str_cat.h"
#include "absl/time/time.h"
#include "server/postgres/postgres_blob_store.h"
#include "tests/server/postgres/blob_store_fixture.h"
#include "tests/support/matchers.h"

namespace isomatch {
namespace {

using PostgresBlobRemovalTest = PostgresBlobStoreTest;

TEST_F(PostgresBlobRemovalTest, RemoveWaitsForTheGrace) {
  Options options = ExactOptions(100);
  options.grace = absl::Minutes(10);
  const auto store = Make(options);
  const BlobKey key = Put(*store, "content");
  Age(11 * 60);
  store->Remove(key);
  EXPECT_EQ(store->size_bytes(), 0);
}

TEST_F(PostgresBlobRemovalTest, WhatWasRemovedTooEarlyGoesOnceItMay) {
  Options options = ExactOptions(100);
  options.grace = absl::Minutes(10);
  const auto store = Make(options);
  const BlobKey removed = Put(*store, "removed");
  Put(*store, "other");
  store->Remove(removed);
  store->Tidy();
  Age(9 * 60);
  Make(options)->Tidy();
  EXPECT_EQ(store->size_bytes(), 12);
  Age(2 * 60);
  Make(options)->Tidy();
  EXPECT_FALSE(store->Has(removed));
  EXPECT_EQ(store->size_bytes(), 5);
}

TEST_F(PostgresBlobRemovalTest, ARemovalIsDueByTheDatabasesClock) {
  Options options = ExactOptions(100);
  options.grace = absl::Milliseconds(300);
  const auto store = Make(options);
  const absl::Time put = absl::Now();
  const BlobKey key = Put(*store, "content");
  store->Remove(key);
  while (store->size_bytes() > 0 && absl::Now() < put + absl::Seconds(20)) {
    store->Tidy();
  }
  EXPECT_EQ(store->size_bytes(), 0);
  EXPECT_GE(absl::Now() - put, options.grace);
}

TEST_F(PostgresBlobRemovalTest, AUseTakesARemovalBack) {
  const auto store = Make({.capacity_bytes = 100});
  const BlobKey key = Put(*store, "content");
  for (const auto use :
       {+[](BlobStore&s, const BlobKey&k) { s.Pin(k); },
        +[](BlobStore&s, const BlobKey&k) { s.Has(k); },
        +[](BlobStore&s, const BlobKey&k) {
          EXPECT_THAT(s.AreThere(k.tenant, {k.sha256}), IsOk());
        },
        +[](BlobStore&s, const BlobKey&) { Put(s, "content"); },
        +[](BlobStore&s, const BlobKey&k) { EXPECT_THAT(s.Get(k), IsOk()); }}) {
    store->Remove(key);
    use(*store, key);
    Age(11 * 60);
    store->Tidy();
    EXPECT_TRUE(store->Has(key));
  }
  database_.Do("UPDATE isomatch.blobs SET is_damaged = true");
  store->Remove(key);
  Put(*store, "content");
  Age(11 * 60);
  store->Tidy();
  EXPECT_TRUE(store->Has(key));
}

TEST_F(PostgresBlobRemovalTest, ARemovalWaitsForJobsThatCameToNeedIt) {
  const auto store = Make({.capacity_bytes = 100});
  const BlobKey key = Put(*store, "content");
  store->Remove(key);
  database_.AddReference("job", key);
  Age(11 * 60);
  store->Tidy();
  EXPECT_EQ(database_.Do("SELECT count(*) FROM isomatch.blobs"), "1");
  database_.RemoveReferences("job");
  store->Tidy();
  EXPECT_EQ(database_.Do("SELECT count(*) FROM isomatch.blobs"), "0");
}

// Its jobs name it, and each of them removes it in turn.
TEST_F(PostgresBlobRemovalTest, RemovingWhatIsNeededIsNotRemembered) {
  const auto store = Make({.capacity_bytes = 100});
  const BlobKey key = Put(*store, "content");
  database_.AddReference("job", key);
  store->Remove(key);
  Age(11 * 60);
  database_.RemoveReferences("job");
  store->Tidy();
  EXPECT_EQ(database_.Do("SELECT count(*) FROM isomatch.blobs"), "1");
}

TEST_F(PostgresBlobRemovalTest, ManyRemovalsAreDoneInSteps) {
  const auto store = Make({.capacity_bytes = 10000});
  database_.Do(
      "INSERT INTO isomatch.blobs SELECT CASE WHEN i % 2 = 0 THEN 'a' ELSE 'b' "
      "END, i::text, 1, 0, false, now(), now() - interval '1 h', now() "
      "FROM generate_series(1, 250) i;"
      "SELECT isomatch.count_blob_bytes('a', 125),"
      "       isomatch.count_blob_bytes('b', 125)");
  store->Tidy();
  EXPECT_EQ(database_.Do("SELECT count(*) FROM isomatch.blobs"), "0");
  EXPECT_EQ(database_.Do("SELECT max(bytes) FROM isomatch.blob_totals"), "0");
}

}  // namespace
}  // namespace isomatch
