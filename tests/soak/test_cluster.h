#pragma once

#include <memory>
#include <string>
#include <thread>
#include <vector>

#include <grpcpp/grpcpp.h>

#include "tests/server/child_process.h"
#include "tests/soak/soak_server.h"
#include "tests/support/postgres_server.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {

/// Gateways and workers as processes of their own, on a PostgreSQL of theirs.
/// What is killed is started again at once; gateways keep their addresses. Not
/// thread-safe.
class TestCluster {
 public:
  struct Options {
    int gateways = 2;
    int workers = 3;
    /// Of all processes.
    std::vector<std::string> flags = {};
    /// What they use as --store, instead of the database itself.
    std::string store = "";
  };

  explicit TestCluster(Options options);
  ~TestCluster();

  int gateways() const { return static_cast<int>(gateways_.size()); }
  int workers() const { return static_cast<int>(workers_.size()); }
  Stub& stub(int gateway) { return *stubs_[static_cast<size_t>(gateway)]; }

  /// Of all gateways, for clients that go on with another one.
  std::string addresses() const;
  const std::string& database_url() const { return database_url_; }

  void KillGateway(int gateway);
  /// `signal` is SIGKILL, or SIGTERM and it gives back what it runs.
  void KillWorker(int worker, int signal);
  void SignalWorker(int worker, int signal) const;
  void KillDatabase();
  /// Cuts all connections to the database.
  void CutConnections();

  /// Runs a statement in the database; returns the first value, or "".
  std::string Ask(const std::string& sql) const;

 private:
  /// A process whose log is read and dropped.
  class Process {
   public:
    explicit Process(const std::vector<std::string>& flags);
    ~Process();
    void End(int signal);
    void Signal(int signal) const { process_.Signal(signal); }

   private:
    ChildProcess process_;
    std::thread log_reader_;
  };

  std::unique_ptr<Process> Start(std::vector<std::string> own) const;
  void StartGateway(size_t gateway);
  void StartWorker(size_t worker);

  const Options options_;
  const std::unique_ptr<PostgresServer> database_;
  std::string database_url_;
  std::string store_;
  std::vector<int> ports_;
  std::vector<std::unique_ptr<Process>> gateways_;
  std::vector<std::unique_ptr<Stub>> stubs_;
  std::vector<std::unique_ptr<Process>> workers_;
};

}  // namespace isomatch
