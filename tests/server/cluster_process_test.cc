// The real isomatch-server on a database: what it says when it starts.

#include <fstream>
#include <iterator>
#include <memory>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <pqxx/pqxx>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "tests/server/child_process.h"
#include "tests/support/matchers.h"
#include "tests/support/postgres_server.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

class ClusterProcessTest : public testing::Test {
 protected:
  void SetUp() override {
    auto database = PostgresServer::Start();
    ASSERT_THAT(database, IsOk());
    database_ = *std::move(database);
  }

  /// Returns what it prints on standard output.
  std::string Migrate() {
    ChildProcess migrate(ISOMATCH_SERVER_BINARY,
                         {"migrate", "--store", database_->url()},
                         folder_.Path("out"));
    EXPECT_EQ(migrate.ExitStatus(), 0);
    std::ifstream out(folder_.Path("out"));
    return {std::istreambuf_iterator<char>(out), {}};
  }

  std::unique_ptr<ChildProcess> Start(const std::string& role,
                                      std::vector<std::string> flags) {
    flags.insert(flags.end(), {"--store", database_->url(), "--role", role,
                               "--metrics-listen", "off"});
    if (role != "worker") {
      flags.insert(flags.end(), {"--listen", "127.0.0.1:0"});
    }
    return std::make_unique<ChildProcess>(ISOMATCH_SERVER_BINARY, flags);
  }

  int CountWorkers(const std::string& name) {
    pqxx::connection database(database_->url());
    pqxx::nontransaction rows(database);
    return rows
        .exec_params("SELECT count(*) FROM isomatch.workers WHERE worker = $1",
                     name)[0][0]
        .as<int>();
  }

  TemporaryFolder folder_;
  std::unique_ptr<PostgresServer> database_;
};

TEST_F(ClusterProcessTest, MigrateSaysWhatItDid) {
  EXPECT_THAT(Migrate(), StartsWith("made the tables of isomatch at "));
  EXPECT_THAT(Migrate(), StartsWith("nothing to do: "));
}

TEST_F(ClusterProcessTest, StartsOnlyOnTables) {
  EXPECT_THAT(Start("worker", {})->ReadUntil("the database has "),
              StartsWith("no tables yet: run isomatch-server migrate"));
}

TEST_F(ClusterProcessTest, AWorkerSaysWhoItIsAndWhereItsDataIs) {
  Migrate();
  const auto worker = Start("worker", {"--blob-dir", folder_.Path("")});
  const std::string said = worker->ReadUntil("worker: ");
  const std::string name = said.substr(0, said.find(' '));
  EXPECT_EQ(worker->ReadUntil("data: "),
            absl::StrCat("in the database of --store and in the folder ",
                         folder_.Path(""), ", for all who use them"));
  for (int i = 0; i < 500 && CountWorkers(name) == 0; ++i) {
    absl::SleepFor(absl::Milliseconds(20));
  }
  EXPECT_EQ(CountWorkers(name), 1) << said;
}

TEST_F(ClusterProcessTest, AGatewaySaysThatItsWorkersChangeNothing) {
  Migrate();
  const auto gateway = Start("gateway", {"--workers", "4"});
  EXPECT_EQ(gateway->ReadUntil("data: "),
            "in the database of --store, for all who use it");
  EXPECT_THAT(gateway->ReadUntil("--workers = "),
              HasSubstr("4 changes nothing: a gateway runs no jobs"));
}

}  // namespace
}  // namespace isomatch
