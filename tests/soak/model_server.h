#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "core/base/mutex.h"
#include "tests/soak/job_model.h"
#include "tests/soak/soak_server.h"
#include "tests/soak/test_cluster.h"

namespace isomatch {

/// What a model is compared with: a server, or several that are one for their
/// clients, with restarts that chance chooses.
class ModelServer {
 public:
  virtual ~ModelServer() = default;

  /// Whoever takes the next call.
  virtual Stub& stub(std::uint64_t random) = 0;

  /// Something ends, by SIGKILL or as it is asked to, and starts again. May
  /// return before that, and waits for the one before.
  virtual void Restart(std::uint64_t random) = 0;
  virtual Restarts restarts() const = 0;

  /// What it promises of jobs.
  virtual JobRules rules() const = 0;
  /// Whether a call may find nobody, or hear no answer: it is repeated then.
  virtual bool may_be_away() const = 0;
};

/// One process with a folder, which is stopped or killed between calls.
class OneModelServer : public ModelServer {
 public:
  explicit OneModelServer(std::vector<std::string> flags);

  Stub& stub(std::uint64_t /*random*/) override { return server_->stub(); }
  void Restart(std::uint64_t random) override;
  Restarts restarts() const override { return {restarts_, restarts_}; }
  JobRules rules() const override { return {}; }
  bool may_be_away() const override { return false; }

 private:
  const TemporaryFolder folder_;
  std::vector<std::string> flags_;
  std::unique_ptr<SoakServer> server_;
  int restarts_ = 0;
};

/// Gateways, workers and their database, which are stopped, killed and cut off
/// while calls go on.
class ClusterModelServer : public ModelServer {
 public:
  explicit ClusterModelServer(const std::vector<std::string>& flags);
  ~ClusterModelServer() override;

  Stub& stub(std::uint64_t random) override {
    return cluster_.stub(static_cast<int>(random % kGateways));
  }
  void Restart(std::uint64_t random) override;
  Restarts restarts() const override { return {begun_, over_}; }
  JobRules rules() const override;
  bool may_be_away() const override { return true; }

 private:
  static constexpr int kGateways = 2;
  static constexpr int kWorkers = 3;

  /// What the thread does, whose children all are that were started again.
  void Inflict();
  void InflictOne(std::uint64_t random);

  TestCluster cluster_;
  std::atomic<int> begun_ = 0;
  std::atomic<int> over_ = 0;

  Mutex mutex_;
  CondVar changed_;
  std::uint64_t random_ ABSL_GUARDED_BY(mutex_) = 0;
  bool is_ended_ ABSL_GUARDED_BY(mutex_) = false;
  std::thread thread_;
};

}  // namespace isomatch
