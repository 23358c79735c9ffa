// Gateways and workers as processes, as Prometheus and Kubernetes see them
// while the database and a worker come and go.

#include <csignal>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "tests/server/metrics/http_get.h"
#include "tests/soak/known_jobs.h"
#include "tests/soak/soak_server.h"
#include "tests/soak/test_cluster.h"
#include "tests/support/matchers.h"

namespace isomatch {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

class ClusterProcessMetricsTest : public testing::Test {
 protected:
  ClusterProcessMetricsTest() {
    for (const std::string& process : Processes())
      WaitUntilReady(process, true);
  }

  std::vector<std::string> Processes() {
    return {cluster_.gateway_metrics(0), cluster_.worker_metrics(0),
            cluster_.worker_metrics(1)};
  }

  static void WaitUntilReady(const std::string& process, bool is_ready) {
    const std::string begin = is_ready ? "HTTP/1.1 200" : "HTTP/1.1 503";
    while (!absl::StartsWith(HttpGet(process, "/readyz"), begin)) {
      absl::SleepFor(absl::Milliseconds(50));
    }
  }

  /// Returns -1 when there is none.
  static double Value(const std::string& process, const std::string& name) {
    const std::string text = HttpGet(process, "/metrics");
    const std::string line = absl::StrCat("\nisomatch_", name, " ");
    const size_t begin = text.find(line);
    if (begin == std::string::npos) return -1;
    const size_t value = begin + line.size();
    double number = 0;
    EXPECT_TRUE(absl::SimpleAtod(
        text.substr(value, text.find('\n', value) - value), &number));
    return number;
  }

  /// Waits until all processes tell this.
  void WaitForAll(const std::string& name, double value) {
    for (const std::string& process : Processes()) {
      while (Value(process, name) != value) {
        absl::SleepFor(absl::Milliseconds(50));
      }
    }
  }

  double Sum(const std::string& name) {
    double sum = 0;
    for (const std::string& process : Processes()) {
      sum += Value(process, name);
    }
    return sum;
  }

  TestCluster cluster_{
      {.gateways = 1,
       .workers = 2,
       .flags = {"--lease", "2s", "--workers", "1", "--drain-timeout", "50ms"},
       .metrics = true}};
};

TEST_F(ClusterProcessMetricsTest, TheDatabaseGoesAndComesBack) {
  const auto job = CreateJob(cluster_.stub(0), LongJob());
  ASSERT_THAT(job, IsOk());
  WaitUntilRuns(cluster_.stub(0), job->name());
  WaitForAll("cluster_jobs_running", 1);
  WaitForAll("workers_registered", 2);
  WaitForAll("database_up", 1);
  EXPECT_EQ(Sum("claims_total"), 1);

  cluster_.database().Kill();
  for (const std::string& process : Processes()) {
    WaitUntilReady(process, false);
    EXPECT_THAT(HttpGet(process, "/readyz"), HasSubstr("\r\n\r\ndatabase: "));
    EXPECT_THAT(HttpGet(process, "/healthz"), StartsWith("HTTP/1.1 200"));
    EXPECT_EQ(Value(process, "database_up"), 0);
    EXPECT_GT(Value(process, "database_errors_total"), 0);
  }

  ASSERT_THAT(cluster_.database().Restart(), IsOk());
  for (const std::string& process : Processes()) WaitUntilReady(process, true);
  WaitForAll("database_up", 1);
  WaitForAll("cluster_jobs_running", 1);
  EXPECT_THAT(CancelJob(cluster_.stub(0), job->name()), IsOk());
  WaitForAll("cluster_jobs_running", 0);
  EXPECT_EQ(Sum("leases_lost_total"), 0);
  EXPECT_EQ(Sum("leases_expired_total"), 0);
}

TEST_F(ClusterProcessMetricsTest, AWorkerThatStopsLosesItsLease) {
  const auto job = CreateJob(cluster_.stub(0), LongJob());
  ASSERT_THAT(job, IsOk());
  WaitUntilRuns(cluster_.stub(0), job->name());
  const int owner =
      Value(cluster_.worker_metrics(0), "jobs_running") == 1 ? 0 : 1;
  cluster_.SignalWorker(owner, SIGSTOP);
  const std::string other = cluster_.worker_metrics(1 - owner);
  while (Value(other, "claims_total") != 1) {
    absl::SleepFor(absl::Milliseconds(50));
  }
  cluster_.SignalWorker(owner, SIGCONT);
  const std::string stopped = cluster_.worker_metrics(owner);
  while (Value(stopped, "leases_lost_total") != 1) {
    absl::SleepFor(absl::Milliseconds(50));
  }
  EXPECT_EQ(Value(other, "leases_lost_total"), 0);
  EXPECT_EQ(Sum("leases_expired_total"), 1);
  EXPECT_THAT(CancelJob(cluster_.stub(0), job->name()), IsOk());
}

}  // namespace
}  // namespace isomatch
