#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include <grpcpp/grpcpp.h>

#include "tests/soak/logged_process.h"
#include "tests/soak/soak_server.h"
#include "tests/support/database_proxy.h"
#include "tests/support/pgbouncer.h"
#include "tests/support/postgres_server.h"

namespace isomatch {

/// Gateways and workers as processes of their own, on a PostgreSQL of theirs.
/// What is killed is started again at once; gateways keep their addresses. All
/// processes are children of the thread that started them, also again, and end
/// with it. Not thread-safe, but for stub(), which others may use meanwhile.
class TestCluster {
 public:
  /// How processes reach the database.
  enum class Way {
    kSocket,   ///< its own
    kBouncer,  ///< PgBouncer in transaction mode
    kProxies,  ///< TCP: a proxy for all gateways, and one for each worker
  };

  struct Options {
    int gateways = 2;
    int workers = 3;
    /// Of all processes.
    std::vector<std::string> flags = {};
    /// Whether they tell their metrics.
    bool metrics = false;
    Way way = Way::kSocket;
    /// Of the first workers, how far their clocks are ahead: "+1h", "-1h".
    std::vector<std::string> clocks = {};
    /// Migrates, and runs as all that the constructor starts.
    std::string binary = ISOMATCH_SERVER_BINARY;
  };

  explicit TestCluster(Options options);
  ~TestCluster();

  int gateways() const { return static_cast<int>(gateways_.size()); }
  int workers() const { return static_cast<int>(workers_.size()); }
  Way way() const { return options_.way; }
  Stub& stub(int gateway) { return *At(gateways_, gateway).stub; }

  // HOST:PORT of the metrics.

  const std::string& gateway_metrics(int gateway) {
    return At(gateways_, gateway).metrics;
  }
  const std::string& worker_metrics(int worker) {
    return At(workers_, worker).metrics;
  }

  /// Of all gateways, for clients that go on with another one.
  std::string addresses() const;

  /// Brings the tables to the version of `binary`.
  void Migrate(const std::string& binary);
  void AddGateway(const std::string& binary = ISOMATCH_SERVER_BINARY);
  void AddWorker(const std::string& binary = ISOMATCH_SERVER_BINARY);

  // `signal` is SIGKILL, or SIGTERM and it gives back what it has.

  void KillGateway(int gateway, int signal);
  void KillWorker(int worker, int signal);
  /// It does not start again; the others keep their numbers.
  void RemoveGateway(int gateway);
  void RemoveWorker(int worker);

  /// Starts those again that have ended while they started, as whatever looks
  /// after processes does, because the database did not answer.
  void StartAgain();

  void SignalWorker(int worker, int signal);
  /// Returns once it answers again.
  void KillDatabase();
  PostgresServer& database() { return *database_; }
  /// REQUIRES: Way::kBouncer.
  void KillBouncer();
  /// Cuts all connections to the database: by the proxies, if there are some.
  void CutConnections();

  // REQUIRES: Way::kProxies.

  DatabaseProxy& proxy_of_gateways() { return *proxies_.front(); }
  DatabaseProxy& proxy_of_worker(int worker) {
    return *proxies_[static_cast<size_t>(worker) + 1];
  }
  void SetProxies(DatabaseProxy::Mode mode);

  /// Runs a statement in the database; returns the first value, or "".
  std::string Ask(const std::string& sql) const;

  /// How often the workers that have ended, or were killed, had logged together
  /// that a job SUCCEEDED, by its ID.
  const std::map<std::string, int>& successes() const { return successes_; }
  /// Ends all workers, and returns that.
  const std::map<std::string, int>& EndWorkers();

 private:
  /// What runs a process, and how to start it again.
  struct Member {
    std::string binary;
    std::vector<std::string> flags;
    std::string metrics = "";
    /// Of a gateway.
    std::string address = "";
    std::shared_ptr<grpc::Channel> channel = nullptr;
    std::unique_ptr<Stub> stub = nullptr;
    /// How far its clock is ahead; empty for one that is right.
    std::string clock = "";
    /// Null after Remove.
    std::unique_ptr<LoggedProcess> process = nullptr;
  };

  static Member& At(std::vector<Member>& members, int index) {
    return members[static_cast<size_t>(index)];
  }
  void StartBouncer();
  /// Returns what the next worker, or each gateway, has as --store.
  std::string StoreOfGateways() const;
  std::string StoreOfNextWorker();
  std::string StoreBehind(const DatabaseProxy& proxy) const;
  void WaitForStore() const;
  void Start(Member& member) const;
  void End(Member& member, int signal);

  const Options options_;
  const std::unique_ptr<PostgresServer> database_;
  std::unique_ptr<PgBouncer> bouncer_;
  /// Of the gateways, then of each worker.
  std::vector<std::unique_ptr<DatabaseProxy>> proxies_;
  std::vector<Member> gateways_;
  std::vector<Member> workers_;
  std::map<std::string, int> successes_;
};

}  // namespace isomatch
