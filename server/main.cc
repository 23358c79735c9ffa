#include <csignal>
#include <iostream>
#include <memory>
#include <optional>
#include <thread>

#include <sys/stat.h>
#include <unistd.h>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "core/base/version.h"
#include "server/logging/log.h"
#include "server/rpc/grpc_logging.h"
#include "server/rpc/health_probe.h"
#include "server/server.h"
#include "server/server_flags.h"

namespace isomatch {
namespace {

/// Of --health; container probes should wait a little longer.
constexpr absl::Duration kProbeTimeout = absl::Seconds(2);

/// What the shutdown may take beyond the drain timeout: a second, with the end
/// of the process.
constexpr absl::Duration kLastSecond = absl::Milliseconds(900);

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

/// All that the operator of a new server needs, on one screen.
void LogStart(const ServerConfig& config, const Server& server) {
  const auto say = [](const std::string& line) { Log(LogLevel::kInfo, line); };
  const std::string metrics = server.metrics_address();
  Log(LogLevel::kInfo,
      absl::StrCat("isomatch-server ", kVersion, " listens on ",
                   server.address()),
      {{"address", server.address()}, {"version", kVersion}});
  say(absl::StrCat("security: ", DescribeTls(config), ", ",
                   config.api_keys.empty() ? "no API keys" : "API keys"));
  say(absl::StrCat("data: ", config.is_durable()
                                 ? config.data_dir
                                 : "in memory, gone when the server ends"));
  say(absl::StrCat("jobs: ", config.workers, " at a time, ",
                   server.threads_per_job(), " threads each, ",
                   config.max_queued_jobs, " may wait"));
  say(absl::StrCat("memory: ", server.memory_budget_bytes() >> 20,
                   " MiB for running jobs, ", config.blob_store_bytes >> 20,
                   " MiB for meshes and results"));
  say(absl::StrCat("requests: at most ",
                   FormatBytes(server.limits().max_request_bytes),
                   ", larger meshes are uploaded, up to ",
                   FormatBytes(server.limits().max_mesh_bytes)));
  say(metrics.empty() ? "metrics: off"
                      : absl::StrCat("metrics: http://", metrics, "/metrics"));
  say(absl::StrCat("a first job: isomatch match --server ", server.address(),
                   ClientFlags(config), " X Y -o MAP"));
}

/// Ends the process on a second signal, and when a peer or a job holds up the
/// shutdown: nothing that has to be saved is left then.
void GuardShutdown(const sigset_t& signals, absl::Duration drain) {
  std::thread([signals] {
    int signal = 0;
    sigwait(&signals, &signal);
    _exit(1);
  }).detach();
  std::thread([drain] {
    absl::SleepFor(drain + kLastSecond);
    _exit(0);
  }).detach();
}

/// Returns the exit status: 0 when the server serves.
int ReportHealth(const std::string& address, const TlsFiles& tls) {
  const absl::Status health = ProbeHealth(address, tls, kProbeTimeout);
  if (health.ok()) {
    std::cout << address << " SERVING\n";
    return 0;
  }
  std::cerr << "isomatch-server: " << address << ": " << health.message()
            << "\n";
  return 1;
}

int Serve(const ServerConfig& config) {
  umask(S_IRWXG | S_IRWXO);  // what it stores is nobody else's
  const sigset_t signals = BlockStopSignals();
  const auto server = Server::Create(config);
  if (!server.ok()) {
    std::cerr << "isomatch-server: " << server.status().message() << "\n";
    return 1;
  }
  LogStart(config, **server);
  int signal = 0;
  sigwait(&signals, &signal);
  Log(LogLevel::kInfo,
      absl::StrCat("stopping: no new jobs, running ones get ",
                   absl::FormatDuration(config.drain_timeout)));
  GuardShutdown(signals, config.drain_timeout);
  (*server)->Shutdown(config.drain_timeout);
  Log(LogLevel::kInfo, "stopped");
  return 0;
}

int Main(int argc, char** argv) {
  ServerCommand command;
  if (const auto status = ParseServerFlags(argc, argv, command)) return *status;
  const ServerConfig& config = command.config;
  SetUpLog(command.health_address ? "off" : config.log_level,
           config.log_format == "json" ? LogFormat::kJson : LogFormat::kText);
  RouteGrpcLog();
  if (command.health_address) {
    return ReportHealth(
        *command.health_address,
        {config.tls_cert, config.tls_key, config.tls_client_ca});
  }
  return Serve(config);
}

}  // namespace
}  // namespace isomatch

int main(int argc, char** argv) { return isomatch::Main(argc, argv); }
