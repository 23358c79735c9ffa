#include "server/postgres/postgres_pool.h"

#include <fstream>
#include <memory>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "tests/support/matchers.h"
#include "tests/support/postgres_server.h"

namespace isomatch {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

constexpr auto kUnavailable = absl::StatusCode::kUnavailable;

/// A server that asks its role `changing` for a password.
class PasswordTest : public testing::Test {
 protected:
  void SetUp() override {
    auto server = PostgresServer::Start();
    ASSERT_THAT(server, IsOk());
    server_ = *std::move(server);
    // The first line that fits a connection counts.
    std::ofstream(server_->folder() + "/data/pg_hba.conf")
        << "local all changing scram-sha-256\nlocal all all trust\n";
    ASSERT_THAT(server_->Restart(), IsOk());
    auto owner = PostgresPool::Open({.url = server_->url()});
    ASSERT_THAT(owner, IsOk());
    owner_ = *std::move(owner);
    Do("CREATE ROLE changing LOGIN PASSWORD 'one'");
  }

  absl::StatusOr<std::unique_ptr<PostgresPool>> Open() {
    return PostgresPool::Open(
        {.url = absl::StrCat("postgresql://changing@/isomatch?host=",
                             server_->folder()),
         .password = [this] { return password_; }});
  }

  void Do(const std::string& sql) {
    EXPECT_THAT(owner_->Ask(PostgresPool::Repeat::kNever, sql), IsOk());
  }

  void EndConnections() {
    Do("SELECT pg_terminate_backend(pid) FROM pg_stat_activity "
       "WHERE usename = 'changing'");
  }

  static absl::Status Use(PostgresPool& pool) {
    return pool.Ask(PostgresPool::Repeat::kOnce, "SELECT 1").status();
  }

  std::unique_ptr<PostgresServer> server_;
  std::unique_ptr<PostgresPool> owner_;
  absl::StatusOr<std::string> password_ = "one";
};

TEST_F(PasswordTest, IsThatOfTheMomentAtEachNewConnection) {
  const auto pool = Open();
  ASSERT_THAT(pool, IsOk());
  Do("ALTER ROLE changing PASSWORD 'two'");
  EXPECT_THAT(Use(**pool), IsOk()) << "the connection that it has stays";
  EndConnections();
  EXPECT_THAT(
      Use(**pool),
      StatusIs(kUnavailable, AllOf(HasSubstr("password authentication failed"),
                                   Not(HasSubstr("one")))));
  password_ = "two";
  EXPECT_THAT(Use(**pool), IsOk());
}

TEST_F(PasswordTest, WithoutItThereIsNoConnectionUntilItIsThereAgain) {
  const auto pool = Open();
  ASSERT_THAT(pool, IsOk());
  EndConnections();
  password_ = absl::NotFoundError("no file");
  for (int i = 0; i < 2; ++i) {
    EXPECT_THAT(Use(**pool), StatusIs(kUnavailable, "database: no file"));
  }
  EXPECT_GE((*pool)->errors(), 2);
  password_ = "one";
  EXPECT_THAT(Use(**pool), IsOk());
}

TEST_F(PasswordTest, SaysWhichRightsAreMissing) {
  Do("CREATE SCHEMA isomatch");
  const auto pool = Open();
  ASSERT_THAT(pool, IsOk());
  EXPECT_THAT(
      (*pool)->Ask(PostgresPool::Repeat::kOnce, "SELECT FROM isomatch.jobs"),
      StatusIs(absl::StatusCode::kPermissionDenied,
               AllOf(HasSubstr("permission denied for schema isomatch; the "
                               "role of --store needs rights"),
                     HasSubstr("server/README.md"), Not(HasSubstr("()")))));
}

}  // namespace
}  // namespace isomatch
