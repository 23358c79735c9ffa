#include "server/postgres/postgres_blob_store.h"

#include <atomic>
#include <cstdint>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <pqxx/pqxx>

#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "core/base/sha256.h"
#include "tests/server/postgres/blob_store_fixture.h"
#include "tests/server/storage/blob_store_conformance.h"
#include "tests/support/matchers.h"

namespace isomatch {
namespace {

using testing::_;
using testing::AnyOf;

auto IsUnavailable() { return StatusIs(absl::StatusCode::kUnavailable, _); }

TEST_F(PostgresBlobStoreTest, TwoStoresSeeTheSame) {
  const auto one = Make(ExactOptions(100));
  const auto other_pool = database_.OpenPool();
  PostgresBlobStore other(other_pool.get(), ExactOptions(100));
  const BlobKey key = Put(*one, "content");
  EXPECT_TRUE(other.Has(key));
  EXPECT_EQ(**other.Get(key), "content");
  EXPECT_EQ(other.size_bytes(), 7);
  Put(other, "content");
  EXPECT_EQ(other.size_bytes(), 7);
  other.Remove(key);
  EXPECT_THAT(one->Get(key), IsMissingBlob());
  EXPECT_EQ(one->size_bytes(), 0);
}

TEST_F(PostgresBlobStoreTest, TheLeastRecentlyUsedOfAllProcessesGoesFirst) {
  const auto one = Make(ExactOptions(100));
  const auto other = Make(ExactOptions(100));
  const BlobKey a = Put(*one, std::string(40, 'a'));
  const BlobKey b = Put(*other, std::string(40, 'b'));
  EXPECT_THAT(other->Get(a), IsOk());
  Put(*one, std::string(40, 'c'));
  EXPECT_TRUE(one->Has(a));
  EXPECT_FALSE(one->Has(b));
}

TEST_F(PostgresBlobStoreTest, WhatAJobNeedsStaysUntilItsLastReferenceGoes) {
  const auto store = Make(ExactOptions(100));
  const BlobKey key = Put(*store, std::string(60, 'a'));
  database_.AddReference("one", key);
  database_.AddReference("two", key);
  database_.RemoveReferences("one");
  store->Remove(key);
  const std::string big(60, 'b');
  EXPECT_THAT(store->Put(KeyOf(big), big, Keep::kWhileRoom),
              StatusIs(absl::StatusCode::kResourceExhausted, _));
  EXPECT_TRUE(store->Has(key));
  database_.RemoveReferences("two");
  Put(*store, big);
  EXPECT_FALSE(store->Has(key));
}

TEST_F(PostgresBlobStoreTest, AJobCannotNeedWhatIsNotThere) {
  const auto store = Make(ExactOptions(100));
  const BlobKey key = Put(*store, "content");
  store->Remove(key);
  EXPECT_THROW(database_.AddReference("job", key), pqxx::foreign_key_violation);
}

// Whoever adds a reference locks the row, and nobody knows yet whether he will
// commit.
TEST_F(PostgresBlobStoreTest, WhatAJobIsAboutToNeedStays) {
  const auto store = Make(ExactOptions(100));
  const BlobKey older = Put(*store, std::string(40, 'a'));
  const BlobKey newer = Put(*store, std::string(40, 'b'));
  pqxx::connection connection(database_.server().url());
  pqxx::work creates_job(connection);
  creates_job.exec("INSERT INTO isomatch.job_blobs VALUES ('job', 'tenant', '" +
                   older.sha256 + "', 1)");
  store->Remove(older);
  Put(*store, std::string(40, 'c'));
  creates_job.commit();
  EXPECT_TRUE(store->Has(older));
  EXPECT_FALSE(store->Has(newer));
}

TEST_F(PostgresBlobStoreTest, WhatWasJustUsedStays) {
  Options options = ExactOptions(100);
  options.grace = absl::Minutes(10);
  const auto store = Make(options);
  const BlobKey key = Put(*store, std::string(60, 'a'));
  const std::string big(60, 'b');
  Age(9 * 60);
  store->Remove(key);
  EXPECT_TRUE(store->Pin(key));  // again
  Age(110);
  EXPECT_THAT(store->Put(KeyOf(big), big, Keep::kWhileRoom),
              StatusIs(absl::StatusCode::kResourceExhausted, _));
  EXPECT_TRUE(store->CanMakeRoom(60)) << "in a moment there will be room";
  EXPECT_FALSE(store->MakeTenantRoom(KeyOf(big), 60, 100));
  Age(11);
  EXPECT_TRUE(store->CanMakeRoom(60));
  Put(*store, big);
  EXPECT_FALSE(store->Has(key));
}

TEST_F(PostgresBlobStoreTest, WhatIsRemovedWithoutNeedStaysForLonger) {
  Options options = ExactOptions(100);
  options.grace = absl::Minutes(10);
  const auto store = Make(options);
  const BlobKey key = Put(*store, std::string(60, 'a'));
  Age(9 * 60);
  store->Remove(key);
  EXPECT_TRUE(store->Has(key));
  Age(11 * 60);
  store->Remove(key);
  EXPECT_FALSE(store->Has(key));
}

TEST_F(PostgresBlobStoreTest, WhatWasJustUsedStaysAlsoWhenOthersCannotGo) {
  Options options = ExactOptions(100);
  options.grace = absl::Minutes(10);
  const auto store = Make(options);
  const BlobKey older = Put(*store, std::string(40, 'a'));
  Age(11 * 60);
  Put(*store, std::string(40, 'b'));
  const std::string big(70, 'c');
  EXPECT_THAT(store->Put(KeyOf(big), big, Keep::kWhileRoom),
              StatusIs(absl::StatusCode::kResourceExhausted, _));
  EXPECT_EQ(store->size_bytes(), 80) << "it went although that did not do";
  pqxx::connection connection(database_.server().url());
  pqxx::work creates_job(connection);
  creates_job.exec("INSERT INTO isomatch.job_blobs VALUES ('job', 'tenant', '" +
                   older.sha256 + "', 1)");
  const std::string small(40, 'd');
  EXPECT_THAT(store->Put(KeyOf(small), small, Keep::kWhileRoom),
              StatusIs(absl::StatusCode::kResourceExhausted, _));
  EXPECT_EQ(store->size_bytes(), 80);
}

TEST_F(PostgresBlobStoreTest, AUseIsWrittenOnlyWhenTheLastOneIsOld) {
  const auto store = Make({.capacity_bytes = 100});
  const BlobKey key = Put(*store, "content");
  const std::string put = UsedAt();
  EXPECT_THAT(store->Get(key), IsOk());
  EXPECT_TRUE(store->Has(key));
  EXPECT_TRUE(store->Pin(key));
  Put(*store, "content");
  EXPECT_EQ(UsedAt(), put);
  for (const auto use :
       {+[](BlobStore&s, const BlobKey&k) { s.Pin(k); },
        +[](BlobStore&s, const BlobKey&k) { s.Has(k); },
        +[](BlobStore&s, const BlobKey&) { Put(s, "content"); },
        +[](BlobStore&s, const BlobKey&k) { EXPECT_THAT(s.Get(k), IsOk()); }}) {
    Age(61);
    const std::string old = UsedAt();
    use(*store, key);
    EXPECT_GT(UsedAt(), old);
  }
}

TEST_F(PostgresBlobStoreTest, DamagedContentIsMissingUntilItIsPutAgain) {
  const auto store = Make(ExactOptions(10 * kMiB));
  const auto other = Make(ExactOptions(10 * kMiB));
  const std::string bytes = ManyBytes(kMiB, 1);
  for (const char* damage :
       {"UPDATE isomatch.blob_chunks SET content = set_byte(content, 9, "
        "255 - get_byte(content, 9)) WHERE index = 2",
        "DELETE FROM isomatch.blob_chunks WHERE index = 3",
        "UPDATE isomatch.blobs SET chunks = 0"}) {
    SCOPED_TRACE(damage);
    const BlobKey key = Put(*store, bytes);
    database_.AddReference("job", key);
    database_.Do(damage);
    EXPECT_THAT(store->Get(key), IsMissingBlob());
    EXPECT_FALSE(other->Has(key));
    EXPECT_FALSE(other->Pin(key));
    EXPECT_THAT(other->Get(key), IsMissingBlob());
    Put(*other, bytes);
    EXPECT_EQ(**store->Get(key), bytes);
    EXPECT_EQ(store->size_bytes(), kMiB);
    database_.RemoveReferences("job");
    store->Remove(key);
    EXPECT_EQ(store->size_bytes(), 0);
  }
}

TEST_F(PostgresBlobStoreTest, DamagedContentTakesTheRoomThatItIsPutIn) {
  const auto store = Make(ExactOptions(100));
  const std::string bytes(60, 'a');
  const BlobKey key = Put(*store, bytes);
  database_.AddReference("job", key);
  database_.Do("UPDATE isomatch.blobs SET is_damaged = true");
  EXPECT_TRUE(store->MakeTenantRoom(key, 60, 100));
  Put(*store, bytes);
  EXPECT_EQ(store->size_bytes(), 60);
}

TEST_F(PostgresBlobStoreTest, WhatGoesWhileItIsPutIsThere) {
  Options options = ExactOptions(100);
  options.use_resolution = absl::Hours(1);
  const auto store = Make(options);
  const BlobKey key = Put(*store, "content");
  database_.Do("UPDATE isomatch.blobs SET is_damaged = true");
  pqxx::connection connection(database_.server().url());
  pqxx::work removes(connection);
  removes.exec("SELECT FROM isomatch.blobs FOR UPDATE");
  std::jthread puts([&] { Put(*store, "content"); });
  while (database_.Do("SELECT count(*) FROM pg_locks WHERE NOT granted") ==
         "0") {
  }
  removes.exec("DELETE FROM isomatch.blobs");
  removes.exec("SELECT isomatch.count_blob_bytes('tenant', -7)");
  removes.commit();
  puts.join();
  EXPECT_EQ(**store->Get(key), "content");
  EXPECT_EQ(store->size_bytes(), 7);
}

TEST_F(PostgresBlobStoreTest, ManyAreLookedForInOneStatement) {
  const auto store = Make(ExactOptions(1000));
  std::vector<std::string> sha256s;
  for (int i = 0; i < 50; ++i) {
    sha256s.push_back(Put(*store, std::to_string(i)).sha256);
  }
  const auto transactions = [&] {
    return std::stoi(database_.Do("SELECT pg_current_xact_id()"));
  };
  const int before = transactions();
  EXPECT_THAT(*store->AreThere("tenant", sha256s), testing::Each(true));
  EXPECT_LT(transactions() - before, 10);  // each use is one that writes
}

TEST_F(PostgresBlobStoreTest, ADatabaseThatDoesNotAnswerIsNoMissingBlob) {
  const auto store = Make(ExactOptions(100));
  const BlobKey key = Put(*store, "content");
  EXPECT_EQ(store->size_bytes(), 7);
  database_.server().Kill();
  EXPECT_THAT(store->AreThere(key.tenant, {key.sha256}), IsUnavailable());
  EXPECT_THAT(store->Get(key), IsUnavailable());
  EXPECT_THAT(store->Put(key, "content", Keep::kPinned), IsUnavailable());
  EXPECT_THAT(store->PutWithin(100, key, "content", Keep::kPinned),
              IsUnavailable());
  EXPECT_THAT(store->TryWriting(0), IsUnavailable());
  EXPECT_FALSE(store->Has(key));
  EXPECT_TRUE(store->Pin(key));
  EXPECT_TRUE(store->CanMakeRoom(1000));
  EXPECT_EQ(store->size_bytes(), 7);
  store->Remove(key);
  ASSERT_THAT(database_.server().Restart(), IsOk());
  EXPECT_EQ(**store->Get(key), "content");
  Put(*store, "more");
  EXPECT_EQ(store->size_bytes(), 11);
  EXPECT_THAT(store->TryWriting(0), IsOk());
}

TEST_F(PostgresBlobStoreTest, EachErrorOfTheDatabaseHasItsMeaning) {
  const auto store = Make(ExactOptions(100));
  const BlobKey key = Put(*store, "content");
  database_.Do(
      "CREATE FUNCTION isomatch.fail() RETURNS trigger LANGUAGE plpgsql AS "
      "$$ BEGIN RAISE disk_full; END $$;"
      "CREATE TRIGGER fails BEFORE INSERT ON isomatch.blob_chunks "
      "FOR EACH ROW EXECUTE FUNCTION isomatch.fail()");
  EXPECT_THAT(store->Put(KeyOf("more"), "more", Keep::kPinned),
              StatusIs(absl::StatusCode::kResourceExhausted, _));
  EXPECT_FALSE(store->Has(KeyOf("more")));
  EXPECT_EQ(store->size_bytes(), 7);

  database_.Do("ALTER TABLE isomatch.blob_chunks RENAME TO chunks");
  EXPECT_THAT(store->Put(KeyOf("more"), "more", Keep::kPinned),
              IsUnavailable());
  EXPECT_THAT(store->Get(key), IsUnavailable());

  database_.Do(
      "CREATE FUNCTION isomatch.bad_sector() RETURNS bytea LANGUAGE plpgsql AS "
      "$$ BEGIN RAISE data_corrupted; END $$;"
      "CREATE VIEW isomatch.blob_chunks AS SELECT tenant, sha256, index, "
      "isomatch.bad_sector() AS content FROM isomatch.chunks");
  EXPECT_THAT(store->Get(key), IsMissingBlob());
  EXPECT_FALSE(store->Has(key));
}

TEST_F(PostgresBlobStoreTest, ManyMegabytesComeBackAsTheyWere) {
  const auto store = Make(ExactOptions(100 * kMiB));
  for (const std::int64_t size : {20 * kMiB, 20 * kMiB + 1, kMiB / 4,
                                  kMiB / 4 - 1, 4 * kMiB, std::int64_t{0}}) {
    const std::string bytes = ManyBytes(size, 7);
    const BlobKey key = Put(*store, bytes);
    const auto got = store->Get(key);
    ASSERT_THAT(got, IsOk());
    EXPECT_TRUE(**got == bytes) << size;
  }
  EXPECT_EQ(database_.Do("SELECT max(length(content)) FROM "
                         "isomatch.blob_chunks"),
            "262144");
  EXPECT_EQ(database_.Do("SELECT pg_total_relation_size("
                         "'isomatch.blob_chunks') < 60 * 1024 * 1024"),
            "t");
}

TEST_F(PostgresBlobStoreTest, TheSameMayBePutByManyAtOnce) {
  constexpr int kThreads = 8;
  const std::string bytes = ManyBytes(3 * kMiB, 3);
  const BlobKey key = KeyOf(bytes);
  std::vector<std::unique_ptr<PostgresBlobStore>> stores;
  stores.reserve(kThreads);
  for (int i = 0; i < kThreads; ++i) {
    stores.push_back(Make(ExactOptions(100 * kMiB)));
  }
  for (int round = 0; round < 5; ++round) {
    std::vector<std::jthread> threads;
    threads.reserve(kThreads);
    for (const auto& store : stores) {
      threads.emplace_back([&] {
        EXPECT_THAT(store->Put(key, bytes, Keep::kPinned), IsOk());
        EXPECT_THAT(store->Get(key), IsOk());
      });
    }
    threads.clear();
    EXPECT_EQ(stores[0]->size_bytes(), 3 * kMiB);
    EXPECT_EQ(database_.Do("SELECT count(*) FROM isomatch.blob_chunks"), "12");
    stores[0]->Remove(key);
    EXPECT_EQ(stores[0]->size_bytes(), 0);
  }
}

// Puts, removals and evictions of a few keys by several threads: totals stay
// what the tables hold, and nothing waits for each other in a circle.
TEST_F(PostgresBlobStoreTest, TotalsAreRightWhateverHappensAtOnce) {
  constexpr int kThreads = 6;
  std::vector<std::jthread> threads;
  threads.reserve(kThreads);
  for (int i = 0; i < kThreads; ++i) {
    threads.emplace_back([this, i] {
      const auto store = Make(ExactOptions(1000));
      for (int step = 0; step < 60; ++step) {
        const int number = (step * 7 + i * 5) % 12;
        const std::string bytes(static_cast<size_t>(100 + number),
                                static_cast<char>('a' + number));
        const BlobKey key = {number % 3 == 0 ? "one" : "two", Sha256Hex(bytes)};
        EXPECT_THAT(store->Put(key, bytes, Keep::kWhileRoom), IsOk());
        EXPECT_THAT(store->Get(key), AnyOf(IsOk(), IsMissingBlob()));
        if (step % 5 == 0) store->Remove(key);
      }
    });
  }
  threads.clear();
  EXPECT_EQ(database_.Do("SELECT sum(bytes) FROM isomatch.blob_totals"),
            database_.Do("SELECT sum(bytes) FROM isomatch.blobs"));
  EXPECT_EQ(database_.Do("SELECT sum(length(content)) FROM "
                         "isomatch.blob_chunks"),
            database_.Do("SELECT sum(bytes) FROM isomatch.blobs"));
}

TEST_F(PostgresBlobStoreTest, TheCacheSparesTheDatabaseToSendItAgain) {
  Options options = ExactOptions(100);
  options.cache_bytes = 20;
  const auto store = Make(options);
  const BlobKey key = Put(*store, "content");
  EXPECT_THAT(store->Get(key), IsOk());
  database_.Do("DELETE FROM isomatch.blob_chunks");
  EXPECT_EQ(**store->Get(key), "content");
  store->Remove(key);
  EXPECT_THAT(store->Get(key), IsMissingBlob());
}

TEST_F(PostgresBlobStoreTest, TheCacheIsTrustedUntilAUseWouldBeWritten) {
  for (const absl::Duration resolution :
       {absl::ZeroDuration(), absl::Hours(1)}) {
    Options options = ExactOptions(100);
    options.cache_bytes = 20;
    options.use_resolution = resolution;
    const auto store = Make(options);
    const BlobKey key = Put(*store, "content");
    EXPECT_THAT(store->Get(key), IsOk());
    Make(ExactOptions(100))->Remove(key);
    EXPECT_EQ(store->Get(key).ok(), resolution > absl::ZeroDuration());
    store->Remove(key);
    EXPECT_THAT(store->Get(key), IsMissingBlob());
  }
}

TEST_F(PostgresBlobStoreTest, FiguresMayBeAMomentOld) {
  Options options = ExactOptions(100);
  options.figures_age = absl::Hours(1);
  const auto store = Make(options);
  EXPECT_EQ(store->size_bytes(), 0);
  Put(*Make(ExactOptions(100)), "content");
  EXPECT_EQ(store->size_bytes(), 0);
  EXPECT_EQ(Make(options)->size_bytes(), 7);
}

TEST_F(PostgresBlobStoreTest, MuchRoomIsMadeInSteps) {
  const auto store = Make(ExactOptions(10000));
  // More than one statement deletes.
  database_.Do(
      "INSERT INTO isomatch.blobs SELECT 'tenant', i::text, 1, 0, false, now(),"
      " now() FROM generate_series(1, 1200) i");
  database_.Do("SELECT isomatch.count_blob_bytes('tenant', 1200)");
  const std::string needed(9000, 'x');
  database_.AddReference("job", Put(*store, needed));
  EXPECT_EQ(store->size_bytes(), 10000);
  Put(*store, std::string(999, 'y'));
  EXPECT_EQ(store->size_bytes(), 10000);
  const std::string big(1001, 'z');
  EXPECT_THAT(store->Put(KeyOf(big), big, Keep::kWhileRoom),
              StatusIs(absl::StatusCode::kResourceExhausted, _));
  EXPECT_EQ(store->size_bytes(), 10000);
}

TEST_F(PostgresBlobStoreTest, WhatIsTriedToWriteIsTakenBack) {
  const auto store = Make(ExactOptions(100));
  EXPECT_THAT(store->TryWriting(5 * kMiB), IsOk());
  EXPECT_EQ(database_.Do("SELECT count(*) FROM isomatch.blob_probe"), "0");
  EXPECT_EQ(database_.Do("SELECT pg_total_relation_size("
                         "'isomatch.blob_probe') > 5 * 1024 * 1024"),
            "t");
}

}  // namespace
}  // namespace isomatch
