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
  /// Waits until the job's attempt of this number has its meshes and computes;
  /// false when none does.
  bool WaitForAttempt(const std::string& name, std::uint32_t attempt);

  TestCluster cluster_{{.gateways = 1,
                        .workers = 1,
                        .flags = {"--lease", "4s"},
                        .way = TestCluster::Way::kProxies}};
};

bool ClusterPartitionTest::WaitForAttempt(const std::string& name,
                                          std::uint32_t attempt) {
  const absl::Time deadline = absl::Now() + absl::Seconds(30);
  while (absl::Now() < deadline) {
    const auto job = GetJob(cluster_.stub(0), name);
    EXPECT_TRUE(job.ok()) << job.status();
    if (!job.ok() || IsEnd(job->state())) return false;
    const bool computes = job->progress().total_fraction() > 0;
    if (computes && job->attempt() == attempt) return true;
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
  // The first one is done by now, and tells it while the other runs, which
  // cannot tell so before.
  cluster_.proxy_of_worker(1).Set(DatabaseProxy::Mode::kSilent);
  cluster_.proxy_of_worker(0).Set(DatabaseProxy::Mode::kPass);
  absl::SleepFor(absl::Seconds(1));
  cluster_.proxy_of_worker(1).Set(DatabaseProxy::Mode::kPass);

  const auto job = WaitForEnd(cluster_.stub(0), name);
  ASSERT_TRUE(job.ok()) << job.status();
  EXPECT_EQ(job->state(), v1::Job::STATE_SUCCEEDED) << job->DebugString();
  EXPECT_EQ(job->attempt(), 2);
  cluster_.RemoveWorker(1);
  const std::string id = name.substr(name.find('/') + 1);
  EXPECT_EQ(cluster_.successes().count(id), 1) << "it is not the second's";
  // The first one still takes jobs.
  const auto next = CreateJob(cluster_.stub(0), MediumJob());
  ASSERT_TRUE(next.ok()) << next.status();
  const auto end = WaitForEnd(cluster_.stub(0), next->name());
  ASSERT_TRUE(end.ok()) << end.status();
  EXPECT_EQ(end->state(), v1::Job::STATE_SUCCEEDED) << end->DebugString();
  EXPECT_EQ(end->attempt(), 1);

  const auto after = GetJob(cluster_.stub(0), name);
  ASSERT_TRUE(after.ok()) << after.status();
  EXPECT_EQ(after->sequence(), job->sequence());
  for (const auto& [job_id, count] : cluster_.EndWorkers()) {
    EXPECT_EQ(count, 1) << job_id;
  }
}

}  // namespace
}  // namespace isomatch
