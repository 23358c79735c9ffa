// Programs of two versions work side by side on one database while a cluster is
// brought up to this one's, as server/README.md says: migrate first, then the
// processes one after the other. ISOMATCH_OLD_SERVER=PATH names the older
// isomatch-server.

#include <cstdlib>
#include <memory>
#include <string>

#include <gtest/gtest.h>
#include <unistd.h>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "tests/soak/figures.h"
#include "tests/soak/soak_server.h"
#include "tests/soak/test_cluster.h"
#include "tests/soak/told_jobs.h"

namespace isomatch {
namespace {

class UpgradeTest : public testing::Test {
 protected:
  void SetUp() override {
    const char* const path = std::getenv("ISOMATCH_OLD_SERVER");
    if (path == nullptr) {
      GTEST_SKIP() << "no older program: set ISOMATCH_OLD_SERVER to the path "
                      "of an isomatch-server that has --store";
    }
    ASSERT_EQ(access(path, X_OK), 0) << "ISOMATCH_OLD_SERVER=" << path;
    cluster_ = std::make_unique<TestCluster>(TestCluster::Options{
        .gateways = 1,
        .workers = 1,
        .flags = {"--max-kept-jobs", "1000000", "--max-queued-jobs", "1000"},
        .binary = path});
    // Nothing is killed: no job ends for that.
    told_ = std::make_unique<ToldJobs>(PrintedSeed(), /*least_attempts=*/1000);
  }

  /// Clients send jobs by each of the gateways from `first` on, and look at
  /// them, while the cluster is at this step.
  void Work(const std::string& step, int first);

  std::unique_ptr<TestCluster> cluster_;
  std::unique_ptr<ToldJobs> told_;
};

void UpgradeTest::Work(const std::string& step, int first) {
  const int before = told_->sent();
  const int calls = Rounds("ISOMATCH_UPGRADE_CALLS", 150, 3000);
  for (int i = 0; i < calls; ++i) {
    const int gateway = first + told_->Random(cluster_->gateways() - first);
    EXPECT_TRUE(told_->Step(cluster_->stub(gateway), step)) << step;
  }
  PrintFigure(absl::StrCat("upgrade: jobs sent, ", step),
              told_->sent() - before, "");
}

TEST_F(UpgradeTest, TwoVersionsWorkSideBySide) {
  ASSERT_FALSE(HasFailure()) << "the older program does not serve";
  Work("older program", /*first=*/0);
  cluster_->Migrate(ISOMATCH_SERVER_BINARY);
  Work("older program, newer tables", /*first=*/0);
  // Older workers run what newer gateways accept, and the other way round.
  cluster_->AddGateway();
  Work("newer gateway, older worker", /*first=*/0);
  cluster_->AddWorker();
  Work("both of both", /*first=*/0);
  cluster_->RemoveWorker(0);
  Work("newer worker, both gateways", /*first=*/0);
  cluster_->RemoveGateway(0);
  Work("newer program", /*first=*/1);

  told_->CheckAtTheEnd(cluster_->stub(1));
  ExpectAtMost("upgrade: accepted jobs lost", told_->lost(), 0, "");
  ExpectAtMost("upgrade: results or states wrong", told_->wrong(), 0, "");
  EXPECT_EQ(told_->given_up(), 0);
  const std::string there = absl::StrCat(told_->there());
  EXPECT_EQ(cluster_->Ask("SELECT count(*) FROM isomatch.jobs"), there);
  for (const auto& [id, count] : cluster_->EndWorkers()) {
    EXPECT_EQ(count, 1) << id;
  }
}

}  // namespace
}  // namespace isomatch
