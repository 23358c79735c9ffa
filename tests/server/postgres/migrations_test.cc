#include "server/postgres/migrations.h"

#include <memory>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"
#include "server/postgres/schema_files.h"
#include "tests/server/postgres/test_database.h"
#include "tests/support/matchers.h"

namespace isomatch {
namespace {

using testing::AllOf;
using testing::HasSubstr;

class MigrationsTest : public testing::Test {
 protected:
  void SetUp() override {
    auto database = NewDatabase();
    ASSERT_THAT(database, IsOk());
    pool_ = *std::move(database);
  }

  /// Returns the first value of the answer.
  std::string Ask(const std::string& sql) {
    const auto rows = pool_->Ask(PostgresPool::Repeat::kOnce, sql);
    EXPECT_THAT(rows, IsOk());
    return rows.ok() && !rows->empty() ? (*rows)[0][0].as<std::string>("") : "";
  }
  void DropTables() { Ask("DROP SCHEMA isomatch CASCADE"); }
  /// What a newer program does that knows one file more.
  void MigrateFurther(int oldest_program) {
    Ask(absl::StrCat(
        "INSERT INTO isomatch.migrations (number, name, "
        "oldest_program) VALUES (",
        kNumSchemaFiles + 1, ", 'of tomorrow', ", oldest_program, ")"));
  }
  /// One row for each file of this program.
  std::string Migrations() {
    return Ask(
        "SELECT string_agg(number::text, ' ' ORDER BY number) "
        "FROM isomatch.migrations");
  }

  std::unique_ptr<PostgresPool> pool_;
};

TEST_F(MigrationsTest, TwiceIsAsGoodAsOnce) {
  const std::string once = Migrations();
  const std::string applied =
      Ask("SELECT max(applied) FROM isomatch.migrations");
  EXPECT_THAT(CheckSchema(*pool_), IsOk());
  const auto migrated = Migrate(*pool_);
  ASSERT_THAT(migrated, IsOk());
  EXPECT_EQ(migrated->from, kNumSchemaFiles);
  EXPECT_EQ(migrated->to, kNumSchemaFiles);
  EXPECT_EQ(Migrations(), once);
  EXPECT_EQ(Ask("SELECT max(applied) FROM isomatch.migrations"), applied);
  EXPECT_THAT(CheckSchema(*pool_), IsOk());
}

TEST_F(MigrationsTest, SeveralProcessesAtOnceDoNoHarm) {
  const std::string once = Migrations();
  for (int round = 0; round < 5; ++round) {
    DropTables();
    {
      std::vector<std::jthread> processes;
      for (int i = 0; i < 4; ++i) {
        processes.emplace_back([this] {
          // With connections of its own.
          const auto pool = PostgresPool::Open(pool_->options());
          ASSERT_THAT(pool, IsOk());
          EXPECT_THAT(Migrate(**pool), IsOk());
        });
      }
    }
    EXPECT_EQ(Migrations(), once);
    EXPECT_THAT(CheckSchema(*pool_), IsOk());
  }
}

TEST_F(MigrationsTest, MissingTablesAreMadeByMigrate) {
  DropTables();
  EXPECT_THAT(CheckSchema(*pool_),
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       AllOf(HasSubstr("the database has no tables yet"),
                             HasSubstr("isomatch-server migrate"))));
  const auto migrated = Migrate(*pool_);
  ASSERT_THAT(migrated, IsOk());
  EXPECT_EQ(migrated->database,
            absl::StrCat("isomatch at ", (*TheServer())->folder()));
  EXPECT_EQ(migrated->from, 0);
  EXPECT_EQ(migrated->to, kNumSchemaFiles);
  EXPECT_THAT(CheckSchema(*pool_), IsOk());
}

TEST_F(MigrationsTest, OlderTablesAreBroughtUpByMigrate) {
  // As a program that knew one file less has left them.
  Ask(absl::StrCat("DELETE FROM isomatch.migrations WHERE number = ",
                   kNumSchemaFiles));
  EXPECT_THAT(
      CheckSchema(*pool_),
      StatusIs(absl::StatusCode::kFailedPrecondition,
               AllOf(HasSubstr(absl::StrCat("version ", kNumSchemaFiles - 1)),
                     HasSubstr("isomatch-server migrate"))));
}

TEST_F(MigrationsTest, NewerTablesThatNeedANewerProgramAreRefused) {
  MigrateFurther(/*oldest_program=*/kNumSchemaFiles + 1);
  const auto is_refused = StatusIs(
      absl::StatusCode::kFailedPrecondition,
      AllOf(HasSubstr(absl::StrCat("at least version ", kNumSchemaFiles + 1)),
            HasSubstr(absl::StrCat("this one knows ", kNumSchemaFiles)),
            HasSubstr("a newer isomatch-server has migrated it")));
  EXPECT_THAT(CheckSchema(*pool_), is_refused);
  EXPECT_THAT(Migrate(*pool_), is_refused);
}

TEST_F(MigrationsTest, NewerTablesThatAllowThisProgramAreAccepted) {
  MigrateFurther(/*oldest_program=*/kNumSchemaFiles);
  EXPECT_THAT(CheckSchema(*pool_), IsOk());
  // Also by its migrate, which leaves them as they are.
  const std::string before = Migrations();
  EXPECT_THAT(Migrate(*pool_), IsOk());
  EXPECT_EQ(Migrations(), before);
}

TEST_F(MigrationsTest, ARoleWithoutRightsHearsWhichItNeeds) {
  Ask("DO $$ BEGIN CREATE ROLE stranger LOGIN; "
      "EXCEPTION WHEN duplicate_object THEN END $$");
  const auto pool = PostgresPool::Open(
      {.url = absl::StrCat("postgresql://stranger@/isomatch?host=",
                           (*TheServer())->folder())});
  ASSERT_THAT(pool, IsOk());
  EXPECT_THAT(CheckSchema(**pool),
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       HasSubstr("the role of --store needs rights on the "
                                 "schema isomatch")));
  Ask("GRANT USAGE ON SCHEMA isomatch TO stranger");
  Ask("GRANT SELECT ON ALL TABLES IN SCHEMA isomatch TO stranger");
  EXPECT_THAT(CheckSchema(**pool), IsOk());
}

}  // namespace
}  // namespace isomatch
