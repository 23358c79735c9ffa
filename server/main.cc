#include <csignal>
#include <iostream>
#include <memory>
#include <optional>
#include <string>
#include <thread>

#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include "absl/time/clock.h"
#include "core/base/version.h"
#include "server/rpc/grpc_logging.h"
#include "server/server.h"
#include "server/server_flags.h"

namespace isomatch {
namespace {

void SetUpLog(const ServerConfig& config) {
  spdlog::set_default_logger(spdlog::stderr_color_mt("isomatch-server"));
  spdlog::set_level(spdlog::level::from_str(config.log_level));
  spdlog::set_pattern("%Y-%m-%dT%H:%M:%S.%e%z %^%l%$ %v");
  RouteGrpcLogToSpdlog();
}

/// Blocks the signals in this thread and those it starts, for sigwait.
sigset_t BlockStopSignals() {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGTERM);
  sigaddset(&signals, SIGINT);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  return signals;
}

/// Who is let in, in words.
const char* DescribeTls(const ServerConfig& config) {
  if (config.tls_cert.empty()) return "no TLS";
  return config.tls_client_ca.empty() ? "TLS" : "TLS with client certificates";
}

/// What a client has to add to its first command.
std::string ClientFlags(const ServerConfig& config) {
  std::string flags;
  if (!config.tls_cert.empty()) flags += " --tls-ca CA";
  if (!config.tls_client_ca.empty()) flags += " --tls-cert CERT --tls-key KEY";
  if (!config.api_keys.empty()) flags += " --api-key-file FILE";
  return flags;
}

void LogStart(const ServerConfig& config, const Server& server) {
  spdlog::info("isomatch-server {} listens on {}", kVersion, server.address());
  spdlog::info("security: {}, {}", DescribeTls(config),
               config.api_keys.empty() ? "no API keys" : "API keys");
  spdlog::info("jobs: {} at a time, {} threads each, {} may wait",
               config.workers, server.threads_per_job(),
               config.max_queued_jobs);
  spdlog::info("memory: {} MiB for running jobs, {} MiB for meshes and results",
               server.memory_budget_bytes() >> 20,
               config.blob_store_bytes >> 20);
  spdlog::info("data: {}", config.data_dir.empty()
                               ? "in memory, gone when the server ends"
                               : config.data_dir);
  spdlog::info("requests: at most {} KiB, larger meshes are uploaded",
               config.max_request_bytes >> 10);
  spdlog::info("a first job: isomatch match --server {}{} X Y -o MAP",
               server.address(), ClientFlags(config));
}

/// Ends the process on a second signal, and when a peer or a job holds up the
/// shutdown: what has to be saved is on disk at any time.
void GuardShutdown(const sigset_t& signals, absl::Duration drain) {
  std::thread([signals] {
    int signal = 0;
    sigwait(&signals, &signal);
    _exit(1);
  }).detach();
  std::thread([drain] {
    absl::SleepFor(drain + absl::Seconds(1));
    _exit(0);
  }).detach();
}

int Main(int argc, char** argv) {
  ServerConfig config;
  if (const auto status = ParseServerFlags(argc, argv, config)) return *status;
  SetUpLog(config);
  const sigset_t signals = BlockStopSignals();
  const auto server = Server::Create(config);
  if (!server.ok()) {
    std::cerr << "isomatch-server: " << server.status().message() << "\n";
    return 1;
  }
  LogStart(config, **server);
  int signal = 0;
  sigwait(&signals, &signal);
  spdlog::info("stopping: no new jobs, running ones get {}",
               absl::FormatDuration(config.drain_timeout));
  GuardShutdown(signals, config.drain_timeout);
  (*server)->Shutdown(config.drain_timeout);
  spdlog::info("stopped");
  return 0;
}

}  // namespace
}  // namespace isomatch

int main(int argc, char** argv) { return isomatch::Main(argc, argv); }
