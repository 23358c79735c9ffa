#include "tests/soak/model_server.h"

#include <csignal>
#include <utility>

#include <gtest/gtest.h>

#include "absl/time/clock.h"

namespace isomatch {

OneModelServer::OneModelServer(std::vector<std::string> flags)
    : flags_(std::move(flags)) {
  flags_.insert(flags_.end(), {"--data-dir", folder_.Path("data"), "--workers",
                               "2", "--threads-per-job", "1"});
  server_ = std::make_unique<SoakServer>(flags_);
}

void OneModelServer::Restart(std::uint64_t random) {
  const bool kill = random % 2 == 0;
  server_->Signal(kill ? SIGKILL : SIGTERM);
  EXPECT_EQ(server_->ExitStatus(), kill ? -1 : 0);
  ++restarts_;
  server_ = std::make_unique<SoakServer>(flags_);
}

ClusterModelServer::ClusterModelServer(const std::vector<std::string>& flags)
    : cluster_({.gateways = kGateways, .workers = kWorkers, .flags = flags}),
      thread_([this] { Inflict(); }) {}

ClusterModelServer::~ClusterModelServer() {
  {
    MutexLock lock(mutex_);
    is_ended_ = true;
    changed_.NotifyAll();
  }
  thread_.join();
}

JobRules ClusterModelServer::rules() const {
  // Three that die with a job alone fail it; their leases run out later. Claims
  // and renewals do not wait for the database's disk.
  return {.least_attempts = 3,
          .goes_back_later = true,
          .loses_last_moment = true,
          .forgets_meshes_at_once = false};
}

void ClusterModelServer::Restart(std::uint64_t random) {
  MutexLock lock(mutex_);
  while (over_ < begun_) changed_.Wait(mutex_);
  random_ = random;
  ++begun_;
  changed_.NotifyAll();
}

void ClusterModelServer::Inflict() {
  while (true) {
    std::uint64_t random = 0;
    {
      MutexLock lock(mutex_);
      while (over_ == begun_ && !is_ended_) changed_.Wait(mutex_);
      if (over_ == begun_) return;
      random = random_;
    }
    absl::SleepFor(absl::Milliseconds(random % 31));
    InflictOne(random / 31);
    cluster_.StartAgain();
    MutexLock lock(mutex_);
    ++over_;
    changed_.NotifyAll();
  }
}

void ClusterModelServer::InflictOne(std::uint64_t random) {
  const int signal = random % 2 == 0 ? SIGKILL : SIGTERM;
  const auto any = static_cast<int>(random / 2 % (kGateways * kWorkers));
  switch (random / 64 % 8) {
    case 0:
    case 1:
    case 2:
      return cluster_.KillGateway(any % kGateways, signal);
    case 3:
    case 4:
      return cluster_.KillWorker(any % kWorkers, signal);
    case 5:  // all but one
      for (int i = 1; i < kWorkers; ++i) cluster_.KillWorker(i, signal);
      return;
    case 6:
      return cluster_.KillDatabase();
    default:
      return cluster_.CutConnections();
  }
}

}  // namespace isomatch
