#include <atomic>
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
#include "server/config/server_flags.h"
#include "server/logging/log.h"
#include "server/machine/file_limit.h"
#include "server/rpc/grpc_logging.h"
#include "server/rpc/health_probe.h"
#include "server/server.h"
#include "server/shared_stores.h"

namespace isomatch {
namespace {

/// How long --health waits; container probes should wait a little longer.
constexpr absl::Duration kProbeTimeout = absl::Seconds(2);

/// What the shutdown may take beyond the drain timeout: a second, with the end
/// of the process.
constexpr absl::Duration kLastSecond = absl::Milliseconds(900);

/// Exit status of a server that jobs have taken over.
constexpr int kGaveUp = 3;

/// What the jobs beside those get to stop.
constexpr absl::Duration kGiveUpGrace = absl::Seconds(1);

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

std::string DescribeConnections(const ConnectionLimits& limits) {
  std::string text = absl::StrCat("connections: at most ", limits.most);
  if (limits.of_one_address > 0) {
    absl::StrAppend(&text, ", ", limits.of_one_address,
                    " from one address other than this machine");
  }
  return text;
}

/// What an operator should not have to find out from the first attack.
void WarnOfFloods(const ServerConfig& config) {
  if (config.behind_edge || !config.is_exposed()) return;
  Log(LogLevel::kWarning,
      absl::StrCat("--listen = ", config.listen,
                   " can be reached by other machines, and gRPC lets a peer "
                   "without a key fill the memory (HTTP/2 resets, endless "
                   "headers). Put a proxy in front that stops this, such as "
                   "docker/edge, and say so by --behind-edge"));
}

/// Where jobs and their bytes are.
std::string DescribeData(const ServerConfig& config) {
  if (config.is_shared()) {
    return config.blob_dir.empty()
               ? "in the database of --store, for all who use it"
               : absl::StrCat("in the database of --store and in the folder ",
                              config.blob_dir, ", for all who use them");
  }
  return config.has_folder() ? config.data_dir
                             : "in memory, gone when the server ends";
}

/// What others that use --store know it as.
void LogWorkerName(const Server& server) {
  Log(LogLevel::kInfo,
      absl::StrCat("worker: ", server.process_name(),
                   " in the table isomatch.workers"),
      {{"worker", server.process_name()}});
}

std::string DescribeJobs(const ServerConfig& config, const Server& server) {
  return absl::StrCat(config.workers, " at a time, ", server.threads_per_job(),
                      " threads each");
}

/// The same for one that nobody calls.
void LogWorkerStart(const ServerConfig& config, const Server& server) {
  const auto say = [](const std::string& line) { Log(LogLevel::kInfo, line); };
  const std::string metrics = server.metrics_address();
  Log(LogLevel::kInfo,
      absl::StrCat("isomatch-server ", kVersion, " runs jobs of --store"),
      {{"version", kVersion}});
  LogWorkerName(server);
  say(absl::StrCat("data: ", DescribeData(config)));
  say(absl::StrCat("jobs: ", DescribeJobs(config, server)));
  say(absl::StrCat("memory: ", server.memory_budget_bytes() >> 20,
                   " MiB for running jobs"));
  say(metrics.empty() ? "metrics: off"
                      : absl::StrCat("metrics: http://", metrics, "/metrics"));
}

/// All that the operator of a new server needs, on one screen.
void LogStart(const ServerConfig& config, const Server& server) {
  const auto say = [](const std::string& line) { Log(LogLevel::kInfo, line); };
  const std::string metrics = server.metrics_address();
  if (server.address().empty()) {
    return LogWorkerStart(config, server);
  }
  Log(LogLevel::kInfo,
      absl::StrCat("isomatch-server ", kVersion, " listens on ",
                   server.address()),
      {{"address", server.address()}, {"version", kVersion}});
  say(absl::StrCat("security: ", DescribeTls(config), ", ",
                   config.api_keys.empty() ? "no API keys" : "API keys"));
  if (config.is_shared() && config.runs_jobs()) LogWorkerName(server);
  say(absl::StrCat("data: ", DescribeData(config)));
  say(absl::StrCat("jobs: ",
                   config.runs_jobs() ? DescribeJobs(config, server)
                                      : "run by workers elsewhere",
                   ", ", config.max_queued_jobs, " may wait"));
  say(absl::StrCat("memory: ", server.memory_budget_bytes() >> 20,
                   " MiB for running jobs, ", config.blob_store_bytes >> 20,
                   " MiB for meshes and results"));
  say(absl::StrCat("requests: at most ",
                   FormatBytes(server.limits().max_request_bytes),
                   ", larger meshes are uploaded, up to ",
                   FormatBytes(server.limits().max_mesh_bytes)));
  say(DescribeConnections(server.connection_limits()));
  say(metrics.empty() ? "metrics: off"
                      : absl::StrCat("metrics: http://", metrics, "/metrics"));
  say(absl::StrCat("a first job: isomatch match --server ", server.address(),
                   ClientFlags(config), " X Y -o MAP"));
  WarnOfFloods(config);
  if (!config.runs_jobs() && config.workers != ServerConfig().workers) {
    Log(LogLevel::kWarning,
        absl::StrCat("--workers = ", config.workers,
                     " changes nothing: a gateway runs no jobs"));
  }
}

/// How a server ends.
struct Ending {
  int exit_status = 0;
  absl::Duration drain = absl::ZeroDuration();
  /// What jobs get to stop after it.
  absl::Duration grace = absl::ZeroDuration();
};

bool HasRunningJobs(const std::weak_ptr<Server>& weak) {
  const std::shared_ptr<Server> server = weak.lock();
  return server != nullptr && server->running_jobs() > 0;
}

/// Ends the process on a second signal, and when a peer or a job holds up the
/// shutdown: nothing that has to be saved is left then.
void GuardShutdown(const sigset_t& signals, const Ending& ending,
                   const std::weak_ptr<Server>& server) {
  std::thread([signals] {
    int signal = 0;
    sigwait(&signals, &signal);
    _exit(1);
  }).detach();
  std::thread([ending, server] {
    absl::SleepFor(ending.drain);
    const absl::Time latest = absl::Now() + ending.grace;
    while (HasRunningJobs(server) && absl::Now() < latest) {
      absl::SleepFor(absl::Milliseconds(10));
    }
    absl::SleepFor(kLastSecond);
    _exit(ending.exit_status);
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

/// Waits for a signal, or until jobs have taken the server over.
Ending WaitForTheEnd(const ServerConfig& config, const sigset_t& signals,
                     const std::atomic<bool>& has_given_up) {
  int signal = 0;
  sigwait(&signals, &signal);
  if (has_given_up) return {kGaveUp, absl::ZeroDuration(), kGiveUpGrace};
  Log(LogLevel::kInfo,
      absl::StrCat("stopping: no new jobs, running ones get ",
                   absl::FormatDuration(config.drain_timeout)));
  return {0, config.drain_timeout, config.unresponsive_grace};
}

int Serve(const ServerConfig& config) {
  // A file that may not grow is a full disk, not the end.
  (void)std::signal(SIGXFSZ, SIG_IGN);
  umask(S_IRWXG | S_IRWXO);  // what it stores is nobody else's
  RaiseFileLimit();
  const sigset_t signals = BlockStopSignals();
  std::atomic<bool> has_given_up = false;
  const auto give_up = [&](const std::string& reason) {
    Log(LogLevel::kError,
        absl::StrCat("giving up, to be started again: ", reason));
    has_given_up = true;
    kill(getpid(), SIGTERM);
  };
  auto created =
      Server::Create(config, CoreMatchEngine(), give_up, OpenAnyStores);
  if (!created.ok()) {
    std::cerr << "isomatch-server: " << created.status().message() << "\n";
    return 1;
  }
  const std::shared_ptr<Server> server = *std::move(created);
  LogStart(config, *server);
  const Ending ending = WaitForTheEnd(config, signals, has_given_up);
  GuardShutdown(signals, ending, server);
  server->Shutdown(ending.drain);
  Log(LogLevel::kInfo, "stopped");
  if (server->stuck_workers() > 0) _exit(ending.exit_status);
  return ending.exit_status;
}

/// Returns the exit status.
int MigrateTables(const ServerConfig& config) {
  const absl::StatusOr<std::string> migrated = MigrateStore(config);
  if (migrated.ok()) {
    std::cout << *migrated << "\n";
    return 0;
  }
  std::cerr << "isomatch-server: migrate: " << migrated.status().message()
            << "\n";
  return 1;
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
  return command.migrate ? MigrateTables(config) : Serve(config);
}

}  // namespace
}  // namespace isomatch

int main(int argc, char** argv) { return isomatch::Main(argc, argv); }
