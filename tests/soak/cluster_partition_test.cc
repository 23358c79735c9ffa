// A worker that loses the network while it runs a job, and comes back with a
// result when the job is another worker's.

#include <string>

#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "tests/server/test_server.h"
#include "tests/soak/figures.h"
#include "tests/soak/known_jobs.h"
#include "tests/soak/soak_server.h"
#include "tests/soak/test_cluster.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

/// A job that runs for longer than a result needs to arrive.
v1::CreateJobRequest MediumJob() {
  v1::CreateJobRequest request;
  *request.mutable_mesh_x() = ToDraco(BumpySphere(/*levels=*/3));
  *request.mutable_mesh_y() = request.mesh_x();
  request.mutable_options()->set_profile(v1::PROFILE_PAPER);
  return request;
}

class ClusterPartitionTest : public testing::Test {
 protected:
  /// Waits until the job's attempt of this number runs; false when none does.
  bool WaitForAttempt(const std::string& name, std::uint32_t attempt);

  TestCluster cluster_{{.gateways = 1,
                        .workers = 1,
                        .flags = {"--lease", "2s"},
                        .way = TestCluster::Way::kProxies}};
};

bool ClusterPartitionTest::WaitForAttempt(const std::string& name,
                                          std::uint32_t attempt) {
  const absl::Time deadline = absl::Now() + absl::Seconds(30);
  while (absl::Now() < deadline) {
    const auto job = GetJob(cluster_.stub(0), name);
    EXPECT_TRUE(job.ok()) << job.status();
    if (!job.ok() || IsEnd(job->state())) return false;
    const bool runs = job->state() == v1::Job::STATE_RUNNING;
    if (runs && job->attempt() == attempt) return true;
    absl::SleepFor(absl::Milliseconds(5));
  }
  return false;
}

TEST_F(ClusterPartitionTest, ALateResultIsRefused) {
  const auto created = CreateJob(cluster_.stub(0), MediumJob());
  ASSERT_TRUE(created.ok()) << created.status();
  const std::string name = created->name();
  ASSERT_TRUE(WaitForAttempt(name, 1));
  cluster_.proxy_of_worker(0).Set(DatabaseProxy::Mode::kSilent);

  cluster_.AddWorker();
  ASSERT_TRUE(WaitForAttempt(name, 2)) << "the first worker keeps its lease";
  // The first one is done by now, or soon, and tells it while the other runs.
  cluster_.proxy_of_worker(0).Set(DatabaseProxy::Mode::kPass);

  const auto job = WaitForEnd(cluster_.stub(0), name);
  ASSERT_TRUE(job.ok()) << job.status();
  EXPECT_EQ(job->state(), v1::Job::STATE_SUCCEEDED) << job->DebugString();
  EXPECT_EQ(job->attempt(), 2);
  // It still takes jobs, and what it had is of no use.
  cluster_.RemoveWorker(1);
  const auto next = CreateJob(cluster_.stub(0), MediumJob());
  ASSERT_TRUE(next.ok()) << next.status();
  const auto end = WaitForEnd(cluster_.stub(0), next->name());
  ASSERT_TRUE(end.ok()) << end.status();
  EXPECT_EQ(end->state(), v1::Job::STATE_SUCCEEDED) << end->DebugString();
  EXPECT_EQ(end->attempt(), 1);

  const auto after = GetJob(cluster_.stub(0), name);
  ASSERT_TRUE(after.ok()) << after.status();
  EXPECT_EQ(after->sequence(), job->sequence());
  for (const auto& [id, count] : cluster_.EndWorkers()) {
    EXPECT_EQ(count, 1) << id;
  }
}

}  // namespace
}  // namespace isomatch
