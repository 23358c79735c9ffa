// What the operator of the database hears of it.

#include <memory>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "server/postgres/postgres_job_store.h"
#include "tests/server/postgres/test_database.h"
#include "tests/support/matchers.h"

namespace isomatch {
namespace {

using testing::HasSubstr;

class StoreFiguresTest : public testing::Test {
 protected:
  void SetUp() override {
    auto pool = NewDatabase();
    ASSERT_THAT(pool, IsOk());
    pool_ = *std::move(pool);
    store_ = std::make_unique<PostgresJobStore>(pool_.get(),
                                                PostgresJobStore::Options());
  }

  void Do(const std::string& sql) {
    EXPECT_THAT(pool_->Ask(PostgresPool::Repeat::kNever, sql), IsOk()) << sql;
  }

  void Insert(const std::string& id) {
    JobRecord job;
    job.id = id;
    job.tenant = "t";
    ASSERT_THAT(store_->Insert(job), IsOk());
  }

  StoreFigures Measured() {
    // Else it counts what was done up to ten seconds later.
    Do("SELECT pg_stat_force_next_flush()");
    const auto figures = store_->Measure();
    EXPECT_THAT(figures, IsOk());
    return figures.ok() ? *figures : StoreFigures();
  }

  std::unique_ptr<PostgresPool> pool_;
  std::unique_ptr<PostgresJobStore> store_;
};

TEST_F(StoreFiguresTest, RowsAreCountedLiveAndDead) {
  const StoreFigures before = Measured();
  EXPECT_EQ(before.live_rows, 0);
  EXPECT_EQ(before.dead_rows, 0);
  EXPECT_GT(before.table_bytes, 0);  // its indexes
  for (int i = 0; i < 200; ++i) Insert(absl::StrCat("job", i));
  Do("UPDATE isomatch.live_jobs SET passes = 1 WHERE number % 2 = 0");
  const StoreFigures after = Measured();
  EXPECT_EQ(after.live_rows, 200);
  EXPECT_EQ(after.dead_rows, 100);
  EXPECT_GT(after.table_bytes, before.table_bytes);
}

TEST_F(StoreFiguresTest, TheOldestTransactionIsThatOfOthers) {
  EXPECT_EQ(Measured().oldest_transaction, absl::ZeroDuration());
  const auto server = TheServer();
  ASSERT_THAT(server, IsOk());
  pqxx::connection other((*server)->url());
  pqxx::work open(other);
  open.exec("SELECT 1");
  absl::SleepFor(absl::Milliseconds(50));
  const absl::Duration age = Measured().oldest_transaction;
  EXPECT_GE(age, absl::Milliseconds(50));
  EXPECT_LT(age, absl::Minutes(1));
  open.commit();
  EXPECT_EQ(Measured().oldest_transaction, absl::ZeroDuration());
}

TEST_F(StoreFiguresTest, TablesOfANewerProgramAreToldOf) {
  EXPECT_THAT(store_->CheckVersion(), IsOk());
  Do("INSERT INTO isomatch.migrations (number, name, oldest_program) "
     "VALUES (998, 'later', 1)");
  EXPECT_THAT(store_->CheckVersion(), IsOk());  // it can work with them
  Do("INSERT INTO isomatch.migrations (number, name, oldest_program) "
     "VALUES (999, 'too late', 999)");
  EXPECT_THAT(store_->CheckVersion(),
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       HasSubstr("a newer isomatch-server")));
}

TEST_F(StoreFiguresTest, WhatTheDatabaseRefusesIsCounted) {
  Insert("a");
  EXPECT_THAT(store_->Get("none"),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("none")));
  EXPECT_EQ(store_->errors(), 0);
  Do("ALTER TABLE isomatch.workers RENAME TO others");
  EXPECT_FALSE(store_->Workers(absl::Seconds(1)).ok());
  EXPECT_EQ(store_->errors(), 1);
  Do("SELECT count(pg_terminate_backend(pid)) FROM pg_stat_activity "
     "WHERE application_name = 'isomatch' AND pid <> pg_backend_pid()");
  EXPECT_THAT(store_->Get("a"), IsOk());
  const std::int64_t before = store_->errors();
  EXPECT_FALSE(pool_
                   ->Ask(PostgresPool::Repeat::kNever,
                         "SELECT pg_terminate_backend(pg_backend_pid())")
                   .ok());
  EXPECT_EQ(store_->errors(), before + 1);
}

}  // namespace
}  // namespace isomatch
