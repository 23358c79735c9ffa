#include "tests/support/postgres_server.h"

#include <csignal>
#include <cstdlib>
#include <string>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>
#include <pqxx/pqxx>

#include "tests/support/matchers.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

using testing::AllOf;
using testing::HasSubstr;

std::string Ask(pqxx::connection& database, const std::string& sql) {
  pqxx::nontransaction transaction(database);
  return transaction.exec(sql)[0][0].as<std::string>();
}

TEST(PostgresServerTest, WhatWasCommittedSurvivesAKill) {
  const auto server = PostgresServer::Start();
  ASSERT_THAT(server, IsOk());
  pqxx::connection before((*server)->url());
  EXPECT_EQ(Ask(before, "SHOW fsync"), "off");
  pqxx::work work(before);
  work.exec("CREATE TABLE kept AS SELECT 7 AS number");
  work.commit();

  (*server)->Kill();
  EXPECT_EQ((*server)->id(), 0);
  EXPECT_THROW(pqxx::connection((*server)->url()), pqxx::broken_connection);

  ASSERT_THAT((*server)->Restart(), IsOk());
  pqxx::connection after((*server)->url());
  EXPECT_EQ(Ask(after, "SELECT number FROM kept"), "7");
}

TEST(PostgresServerTest, AKillEndsWhatConnectionsDo) {
  ASSERT_EQ(prctl(PR_SET_CHILD_SUBREAPER, 1), 0);  // its orphans are ours
  const auto server = PostgresServer::Start();
  ASSERT_THAT(server, IsOk());
  pqxx::connection database((*server)->url());
  const pid_t busy = std::stoi(Ask(database, "SELECT pg_backend_pid()"));
  std::jthread asks([&database] {
    pqxx::nontransaction endless(database);
    // Does not notice by itself that its server is gone.
    EXPECT_THROW(endless.exec("DO $$ BEGIN LOOP END LOOP; END $$"),
                 pqxx::broken_connection);
  });
  pqxx::connection watcher((*server)->url());
  while (Ask(watcher,
             "SELECT count(*) FROM pg_stat_activity WHERE state = "
             "'active' AND query LIKE 'DO%'") == "0") {
  }
  (*server)->Kill();
  EXPECT_EQ(waitpid(busy, nullptr, WNOHANG), busy);
}

TEST(PostgresServerTest, ServersShareNothing) {
  const auto server = PostgresServer::Start();
  const auto other = PostgresServer::Start({.fsync = true});
  ASSERT_THAT(server, IsOk());
  ASSERT_THAT(other, IsOk());
  pqxx::connection first((*server)->url());
  pqxx::connection second((*other)->url());
  Ask(first, "CREATE TABLE mine AS SELECT 1; SELECT 1");
  EXPECT_EQ(Ask(second, "SELECT to_regclass('mine') IS NULL"), "t");
  EXPECT_EQ(Ask(second, "SHOW fsync"), "on");
}

TEST(PostgresServerTest, EndsWithTheProcessThatStartedIt) {
  ASSERT_EQ(prctl(PR_SET_CHILD_SUBREAPER, 1), 0);  // its orphans are ours
  const TemporaryFolder folder;                    // for what it leaves
  int ends[2];
  ASSERT_EQ(pipe(ends), 0);
  const pid_t starter = fork();
  if (starter == 0) {
    setenv("TEST_TMPDIR", folder.Path("").c_str(), 1);
    const auto server = PostgresServer::Start();
    const pid_t id = server.ok() ? (*server)->id() : 0;
    (void)!write(ends[1], &id, sizeof(id));
    kill(getpid(), SIGKILL);
  }
  pid_t server = 0;
  ASSERT_EQ(read(ends[0], &server, sizeof(server)), sizeof(server));
  ASSERT_GT(server, 0);
  EXPECT_EQ(waitpid(starter, nullptr, 0), starter);
  EXPECT_EQ(waitpid(server, nullptr, 0), server);  // or it waits forever
}

TEST(PostgresServerTest, SaysWhichPackageIsMissing) {
  EXPECT_THAT(FindPostgresProgram("initdb"), IsOk());
  EXPECT_THAT(FindPostgresProgram("initdb-of-tomorrow"),
              StatusIs(absl::StatusCode::kNotFound,
                       AllOf(HasSubstr("initdb-of-tomorrow"),
                             HasSubstr("package postgresql-15"))));
}

}  // namespace
}  // namespace isomatch
