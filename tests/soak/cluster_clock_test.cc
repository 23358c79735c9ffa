// Workers whose clocks are an hour ahead and an hour behind: only the clock of
// the database counts.

#include <csignal>
#include <set>
#include <string>
#include <vector>

#include <google/protobuf/util/time_util.h>
#include <gtest/gtest.h>

#include "absl/time/clock.h"
#include "tests/soak/figures.h"
#include "tests/soak/known_jobs.h"
#include "tests/soak/soak_server.h"
#include "tests/soak/test_cluster.h"

namespace isomatch {
namespace {

using google::protobuf::util::TimeUtil;

constexpr int kKinds = 6;

class ClusterClockTest : public testing::Test {
 protected:
  /// Sends jobs until each worker has begun some; returns their names.
  std::vector<std::string> SendJobs();
  void CheckJob(int kind, const std::string& name);
  /// Makes each process, once, the one that deletes old jobs.
  void LetAllLookAfterOldJobs();

  std::int64_t Count(const std::string& what) const {
    return std::stoll(cluster_.Ask("SELECT count(*) FROM isomatch." + what));
  }

  // Shorter than what the clocks are wrong by.
  TestCluster cluster_{{.gateways = 1,
                        .workers = 2,
                        .flags = {"--lease", "2s", "--job-retention", "30m"},
                        .clocks = {"+1h", "-1h"}}};
  const KnownJobs known_{kKinds};
  const std::int64_t begin_ = absl::ToUnixNanos(absl::Now());
};

std::vector<std::string> ClusterClockTest::SendJobs() {
  const int jobs = Rounds("ISOMATCH_CLOCK_JOBS", 30, 2000);
  std::vector<std::string> names;
  for (int i = 0; i < jobs; ++i) {
    v1::CreateJobRequest request = known_.request(i % kKinds);
    // Waits no hour, and does not end before it has begun to wait.
    request.mutable_queue_timeout()->set_seconds(120);
    const auto job = CreateJob(cluster_.stub(0), request);
    EXPECT_TRUE(job.ok()) << job.status();
    if (job.ok()) names.push_back(job->name());
  }
  return names;
}

void ClusterClockTest::CheckJob(int kind, const std::string& name) {
  const auto job = WaitForEnd(cluster_.stub(0), name);
  ASSERT_TRUE(job.ok()) << job.status();
  ASSERT_EQ(job->state(), v1::Job::STATE_SUCCEEDED) << job->DebugString();
  EXPECT_EQ(job->attempt(), 1) << "its lease ended early";
  EXPECT_EQ(known_.ProblemOfDownload(kind, cluster_.stub(0), name), "");
  const auto created = TimeUtil::TimestampToNanoseconds(job->create_time());
  const auto started = TimeUtil::TimestampToNanoseconds(job->start_time());
  const auto ended = TimeUtil::TimestampToNanoseconds(job->end_time());
  EXPECT_LE(begin_, created) << job->DebugString();
  EXPECT_LE(created, started) << job->DebugString();
  EXPECT_LE(started, ended) << job->DebugString();
  EXPECT_LE(ended, absl::ToUnixNanos(absl::Now())) << job->DebugString();
}

void ClusterClockTest::LetAllLookAfterOldJobs() {
  // Whoever begins to look after jobs deletes the old ones at once.
  for (int i = 0; i < cluster_.workers(); ++i) cluster_.KillWorker(i, SIGTERM);
  const absl::Time deadline = absl::Now() + absl::Seconds(30);
  std::set<std::string> holders;
  while (holders.size() < 3 && absl::Now() < deadline) {
    const std::string holder =
        cluster_.Ask("SELECT holder FROM isomatch.chores");
    if (!holder.empty() && holders.insert(holder).second) {
      absl::SleepFor(absl::Milliseconds(200));  // for what it does then
    }
    cluster_.Ask("DELETE FROM isomatch.chores");
    absl::SleepFor(absl::Milliseconds(20));
  }
  EXPECT_EQ(holders.size(), 3U) << "gateway and workers of now";
}

TEST_F(ClusterClockTest, OnlyTheClockOfTheDatabaseCounts) {
  const std::vector<std::string> names = SendJobs();
  int kind = 0;
  for (const std::string& name : names) CheckJob(kind++ % kKinds, name);
  const auto kept = static_cast<std::int64_t>(names.size());
  EXPECT_EQ(Count("jobs"), kept);
  LetAllLookAfterOldJobs();
  EXPECT_EQ(Count("jobs"), kept) << "deleted early";

  // They go when they are old by the database's clock.
  cluster_.Ask(
      "UPDATE isomatch.jobs SET ended = ended - interval '31 minutes'");
  LetAllLookAfterOldJobs();
  EXPECT_EQ(Count("jobs"), 0);
  std::set<std::string> ids;
  for (const auto& [id, count] : cluster_.EndWorkers()) {
    EXPECT_EQ(count, 1) << id;
    ids.insert(id);
  }
  EXPECT_EQ(ids.size(), names.size());
}

}  // namespace
}  // namespace isomatch
