// Gateways, workers and the database of a cluster are killed, stopped and cut
// off, again and again, at points that chance chooses. What a client was told
// must hold ever after, no job may be lost or run to two results, and whoever
// watches a job hears of its end.

#include <atomic>
#include <csignal>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "client/api/connection.h"
#include "client/api/isomatch_client.h"
#include "tests/soak/figures.h"
#include "tests/soak/soak_server.h"
#include "tests/soak/test_cluster.h"
#include "tests/soak/told_jobs.h"

namespace isomatch {
namespace {

/// How long a worker may be silent.
constexpr absl::Duration kLease = absl::Seconds(2);

/// Those who watch jobs by the client library, whatever happens.
class WatchingClients {
 public:
  explicit WatchingClients(std::string addresses)
      : addresses_(std::move(addresses)) {}

  void Watch(const std::string& name) {
    if (name.empty() || !watched_.insert(name).second) return;
    threads_.emplace_back([this, name] {
      IsomatchClient client(ConnectTo(addresses_));
      // A client that gives up comes again, as a user would.
      for (int attempt = 0; attempt < 10; ++attempt) {
        const auto job = client.Watch(name);
        if (!job.ok() && absl::IsUnavailable(job.status())) continue;
        // Its owner has deleted it meanwhile.
        const bool is_gone = !job.ok() && absl::IsNotFound(job.status());
        if (is_gone || (job.ok() && IsEnd(job->state()))) ++ended_;
        return;
      }
    });
  }

  /// Waits for all; returns how many never heard of an end.
  int CountForgotten() {
    for (std::thread& thread : threads_) thread.join();
    return static_cast<int>(threads_.size()) - ended_;
  }
  int count() const { return static_cast<int>(threads_.size()); }

 private:
  const std::string addresses_;
  std::set<std::string> watched_;
  std::vector<std::thread> threads_;
  std::atomic<int> ended_ = 0;
};

class ClusterChaosTest : public testing::Test {
 protected:
  /// Lets clients work for so long.
  void Work(absl::Duration duration);
  void Inflict();
  void StopAWorkerBeyondItsLease();

  int Random(int bound) { return told_.Random(bound); }
  int AnyWorker() { return Random(cluster_.workers()); }

  TestCluster cluster_{
      {.flags = {"--lease", absl::FormatDuration(kLease), "--max-kept-jobs",
                 "1000000", "--max-queued-jobs", "1000", "--drain-timeout",
                 "50ms"}}};
  // A job may be the victim of three kills by chance.
  ToldJobs told_{PrintedSeed(), /*least_attempts=*/3};
  WatchingClients watchers_{cluster_.addresses()};
  std::map<std::string, int> faults_;
  int round_ = 0;
};

void ClusterChaosTest::Work(absl::Duration duration) {
  const absl::Time end = absl::Now() + duration;
  while (absl::Now() < end) {
    Stub& stub = cluster_.stub(Random(cluster_.gateways()));
    if (!told_.Step(stub, absl::StrCat("round ", round_))) {
      absl::SleepFor(absl::Milliseconds(20));
    }
    if (Random(20) == 0) watchers_.Watch(told_.OpenJob());
  }
}

void ClusterChaosTest::StopAWorkerBeyondItsLease() {
  const int worker = AnyWorker();
  cluster_.SignalWorker(worker, SIGSTOP);
  Work(kLease + absl::Seconds(2));
  cluster_.SignalWorker(worker, SIGCONT);  // it has a late result
}

void ClusterChaosTest::Inflict() {
  const int kind = Random(20);
  if (kind < 8) {
    ++faults_["kill -9 of a worker"];
    cluster_.KillWorker(AnyWorker(), SIGKILL);
  } else if (kind < 13) {
    ++faults_["kill -9 of a gateway"];
    cluster_.KillGateway(Random(cluster_.gateways()));
  } else if (kind < 15) {
    ++faults_["kill -9 of the database"];
    cluster_.KillDatabase();
  } else if (kind < 17) {
    ++faults_["cut of all connections to the database"];
    cluster_.CutConnections();
  } else if (kind < 19) {
    ++faults_["SIGTERM of a worker"];
    cluster_.KillWorker(AnyWorker(), SIGTERM);
  } else {
    ++faults_["SIGSTOP of a worker beyond its lease"];
    StopAWorkerBeyondItsLease();
  }
}

TEST_F(ClusterChaosTest, WhatAClientWasToldHolds) {
  const int rounds = Rounds("ISOMATCH_CLUSTER_ROUNDS", 20, 300);
  for (round_ = 0; round_ < rounds && !HasFailure(); ++round_) {
    Work(absl::Milliseconds(Random(600)));
    Inflict();
  }
  told_.CheckAtTheEnd(cluster_.stub(0));
  const int forgotten = watchers_.CountForgotten();
  for (const auto& [fault, count] : faults_) {
    PrintFigure(absl::StrCat("cluster: ", fault), count, "");
  }
  PrintFigure("cluster: jobs", told_.sent(), "");
  PrintFigure("cluster: watchers", watchers_.count(), "");
  PrintFigure("cluster: jobs ended by it (CRASHED_REPEATEDLY)",
              told_.given_up(), "");
  ExpectAtMost("cluster: accepted jobs lost", told_.lost(), 0, "");
  ExpectAtMost("cluster: results or states wrong", told_.wrong(), 0, "");
  ExpectAtMost("cluster: watchers without an end", forgotten, 0, "");
  EXPECT_EQ(cluster_.Ask("SELECT count(*) FROM isomatch.live_jobs"), "0");
}

}  // namespace
}  // namespace isomatch
