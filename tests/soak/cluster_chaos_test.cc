// Gateways, workers and the database of a cluster are killed, stopped and cut
// off, again and again, at points that chance chooses, by each way to reach the
// database. What a client was told must hold ever after, no job may be lost or
// run to two results, and whoever watches a job hears of its end.

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
#include "absl/strings/str_split.h"
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

using Way = TestCluster::Way;

class ClusterChaosTest : public testing::TestWithParam<Way> {
 protected:
  /// Lets clients work for so long.
  void Work(absl::Duration duration);
  void Inflict();

  // What is inflicted.
  void KillWorker() { cluster_.KillWorker(AnyWorker(), SIGKILL); }
  void EndWorker() { cluster_.KillWorker(AnyWorker(), SIGTERM); }
  void KillGateway() { cluster_.KillGateway(AnyGateway(), SIGKILL); }
  void EndGateway() { cluster_.KillGateway(AnyGateway(), SIGTERM); }
  void KillDatabase() { cluster_.KillDatabase(); }
  void KillBouncer() { cluster_.KillBouncer(); }
  void CutConnections() { cluster_.CutConnections(); }
  void StopWorker();
  void PartWorker();
  void PartAll();
  void RefuseAll();

  // What must hold at the end.
  void CheckTables();
  void CheckSuccesses();
  void PrintFigures();

  int Random(int bound) { return told_.Random(bound); }
  int AnyWorker() { return Random(cluster_.workers()); }
  int AnyGateway() { return Random(cluster_.gateways()); }
  std::string Name(const std::string& figure) const;
  /// Returns the ids of the jobs in the database of which this is true.
  std::vector<std::string> IdsOf(const std::string& condition) const {
    return absl::StrSplit(
        cluster_.Ask("SELECT string_agg(id, ' ') FROM isomatch.jobs WHERE " +
                     condition),
        ' ', absl::SkipEmpty());
  }

  TestCluster cluster_{
      {.flags = {"--lease", absl::FormatDuration(kLease), "--max-kept-jobs",
                 "1000000", "--max-queued-jobs", "1000", "--drain-timeout",
                 "50ms"},
       .way = GetParam()}};
  // A job may be the victim of three kills by chance.
  ToldJobs told_{PrintedSeed(), /*least_attempts=*/3};
  WatchingClients watchers_{cluster_.addresses()};
  std::map<std::string, int> faults_;
  int round_ = 0;
};

void ClusterChaosTest::Work(absl::Duration duration) {
  const absl::Time end = absl::Now() + duration;
  while (absl::Now() < end) {
    Stub& stub = cluster_.stub(AnyGateway());
    if (!told_.Step(stub, absl::StrCat("round ", round_))) {
      absl::SleepFor(absl::Milliseconds(20));
    }
    if (Random(20) == 0) watchers_.Watch(told_.OpenJob());
  }
}

void ClusterChaosTest::StopWorker() {
  const int worker = AnyWorker();
  cluster_.SignalWorker(worker, SIGSTOP);
  Work(kLease + absl::Seconds(2));
  cluster_.SignalWorker(worker, SIGCONT);  // it has a late result
}

void ClusterChaosTest::PartWorker() {
  DatabaseProxy& proxy = cluster_.proxy_of_worker(AnyWorker());
  proxy.Set(DatabaseProxy::Mode::kSilent);
  Work(kLease + absl::Seconds(2));
  proxy.Set(DatabaseProxy::Mode::kPass);
}

void ClusterChaosTest::PartAll() {
  const absl::Duration duration = absl::Milliseconds(Random(4000));
  cluster_.SetProxies(DatabaseProxy::Mode::kSilent);
  std::thread healer([&] {  // calls hang meanwhile
    absl::SleepFor(duration);
    cluster_.SetProxies(DatabaseProxy::Mode::kPass);
  });
  Work(duration);
  healer.join();
}

void ClusterChaosTest::RefuseAll() {
  cluster_.SetProxies(DatabaseProxy::Mode::kRefuse);
  cluster_.CutConnections();
  Work(absl::Milliseconds(Random(2000)));
  cluster_.SetProxies(DatabaseProxy::Mode::kPass);
}

void ClusterChaosTest::Inflict() {
  struct Fault {
    int weight;
    const char* name;
    void (ClusterChaosTest::*inflict)();
  };
  using Chaos = ClusterChaosTest;
  std::vector<Fault> faults = {
      {8, "kill -9 of a worker", &Chaos::KillWorker},
      {4, "kill -9 of a gateway", &Chaos::KillGateway},
      {1, "SIGTERM of a gateway", &Chaos::EndGateway},
      {2, "kill -9 of the database", &Chaos::KillDatabase},
      {2, "cut of all connections to the database", &Chaos::CutConnections},
      {2, "SIGTERM of a worker", &Chaos::EndWorker},
      {1, "SIGSTOP of a worker beyond its lease", &Chaos::StopWorker}};
  if (GetParam() == Way::kBouncer) {
    faults.push_back({3, "kill -9 of PgBouncer", &Chaos::KillBouncer});
  }
  if (GetParam() == Way::kProxies) {
    faults.push_back({2, "worker parted beyond its lease", &Chaos::PartWorker});
    faults.push_back({2, "database parted from all", &Chaos::PartAll});
    faults.push_back({2, "database refuses all", &Chaos::RefuseAll});
  }
  int weights = 0;
  for (const Fault& fault : faults) weights += fault.weight;
  int at = Random(weights);
  for (const Fault& fault : faults) {
    at -= fault.weight;
    if (at >= 0) continue;
    ++faults_[fault.name];
    return (this->*fault.inflict)();
  }
}

std::string ClusterChaosTest::Name(const std::string& figure) const {
  constexpr const char* kWays[] = {"cluster", "cluster by PgBouncer",
                                   "cluster by proxies"};
  return absl::StrCat(kWays[static_cast<int>(GetParam())], ": ", figure);
}

/// Each request has one job, each that SUCCEEDED its result, the others none.
void ClusterChaosTest::CheckTables() {
  const std::string there = absl::StrCat(told_.there());
  EXPECT_EQ(cluster_.Ask("SELECT count(*) FROM isomatch.live_jobs"), "0");
  EXPECT_EQ(cluster_.Ask("SELECT count(*) FROM isomatch.jobs"), there);
  EXPECT_EQ(
      cluster_.Ask("SELECT count(DISTINCT request_id) FROM isomatch.jobs"),
      there);
  EXPECT_EQ(cluster_.Ask("SELECT count(*) FROM isomatch.jobs j WHERE (j.state "
                         "= 3) <> EXISTS (SELECT FROM isomatch.job_blobs b "
                         "WHERE b.job_id = j.id AND b.kind = 2)"),
            "0");
  EXPECT_EQ(cluster_.Ask("SELECT count(*) FROM isomatch.job_blobs b WHERE "
                         "b.kind <> 2 OR NOT EXISTS (SELECT FROM isomatch.jobs "
                         "j WHERE j.id = b.job_id)"),
            "0");
}

/// All workers together have logged each success once. What a fault hides is
/// the line of a worker that was killed, or not answered, just then.
void ClusterChaosTest::CheckSuccesses() {
  const std::map<std::string, int> successes = cluster_.EndWorkers();
  int twice = 0;
  for (const auto& [id, count] : successes) twice += count > 1 ? 1 : 0;
  int untold = 0;
  for (const std::string& id : IdsOf("state = 3")) {
    untold += successes.count(id) == 0 ? 1 : 0;
  }
  int taken_back = 0;
  for (const std::string& id : IdsOf("state <> 3")) {
    taken_back += successes.count(id) == 0 ? 0 : 1;
  }
  const auto logged = static_cast<int>(successes.size());
  PrintFigure(Name("successes that workers logged"), logged, "");
  ExpectAtMost(Name("successes logged twice"), twice, 0, "");
  ExpectAtMost(Name("successes that were none"), taken_back, 0, "");
  ExpectAtMost(Name("successes hidden by a fault"), untold, round_, "");
}

void ClusterChaosTest::PrintFigures() {
  for (const auto& [fault, count] : faults_) {
    PrintFigure(Name(fault), count, "");
  }
  PrintFigure(Name("jobs"), told_.sent(), "");
  PrintFigure(Name("watchers"), watchers_.count(), "");
  PrintFigure(Name("jobs ended by it (CRASHED_REPEATEDLY)"), told_.given_up(),
              "");
  ExpectAtMost(Name("accepted jobs lost"), told_.lost(), 0, "");
  ExpectAtMost(Name("results or states wrong"), told_.wrong(), 0, "");
}

TEST_P(ClusterChaosTest, WhatAClientWasToldHolds) {
  const int quick = GetParam() == Way::kSocket ? 20 : 8;
  ASSERT_FALSE(HasFailure()) << "no cluster";
  const int rounds = Rounds("ISOMATCH_CLUSTER_ROUNDS", quick, 300);
  for (round_ = 0; round_ < rounds && !HasFailure(); ++round_) {
    Work(absl::Milliseconds(Random(600)));
    Inflict();
    cluster_.StartAgain();
  }
  told_.CheckAtTheEnd(cluster_.stub(0));
  const int forgotten = watchers_.CountForgotten();
  PrintFigures();
  ExpectAtMost(Name("watchers without an end"), forgotten, 0, "");
  CheckTables();
  CheckSuccesses();
}

std::string NameOfWay(const testing::TestParamInfo<Way>& way) {
  constexpr const char* kNames[] = {"Direct", "PgBouncer", "Proxies"};
  return kNames[static_cast<int>(way.param)];
}

INSTANTIATE_TEST_SUITE_P(Ways, ClusterChaosTest,
                         testing::Values(Way::kSocket, Way::kBouncer,
                                         Way::kProxies),
                         NameOfWay);

}  // namespace
}  // namespace isomatch
