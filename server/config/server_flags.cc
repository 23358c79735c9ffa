#include "server/config/server_flags.h"

#include <algorithm>
#include <cstdlib>
#include <iostream>
#include <string>

#include <CLI/CLI.hpp>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "core/base/status_macros.h"
#include "core/base/version.h"
#include "server/config/flag_set.h"
#include "server/jobs/caller.h"
#include "server/rpc/health_probe.h"
#include "server/rpc/security/new_api_key.h"

namespace isomatch {
namespace {

constexpr char kDescription[] =
    "isomatch-server: finds dense correspondences between 3D meshes for\n"
    "clients of the gRPC service isomatch.v1.CorrespondenceService.";

constexpr char kFooter[] = R"(
Examples:
  isomatch-server
      One job at a time, all cores, reachable from this machine only.
  isomatch-server --workers 4 --memory-budget 12GiB --max-queued-jobs 1000
      Four jobs side by side in at most 12 GiB.
  isomatch-server --new-api-key alice --tenant lab >> keys.txt 2> alice.key
      A fresh key: its line for the server, the key itself for alice.
  isomatch-server --listen 0.0.0.0:7443 --tls-cert server.crt \
                  --tls-key server.key --api-keys keys.txt
      Open to the network, encrypted, for those who have a key.
  isomatch-server --print-config > isomatch.toml
  isomatch-server --config isomatch.toml
      The same from a file, which the environment and flags override.
  isomatch-server migrate --store postgresql://isomatch@db/isomatch
      Makes or updates the tables of a database that many processes share.
  isomatch-server --store postgresql://isomatch@db/isomatch --role worker
      Runs jobs that gateways (--role gateway) put there, on any machine.
  isomatch-server --health
      Says whether the server that these flags start serves.
  isomatch match --server 127.0.0.1:7443 x.off y.off -o map.txt
      Sends a first job.

SIGTERM or SIGINT: no new jobs, running ones get --drain-timeout, exit 0.
A second signal exits at once. Exit status: 2 wrong values, 3 jobs that do not
stop or take all memory (start it again), 1 other errors.)";

/// What CLI11 tells the user about a name that is none; empty when it is.
std::string CheckTenantName(const std::string& name) {
  if (IsTenantName(name)) return "";
  return absl::StrCat("'", name, "', expected 1 to 63 of a-z, 0-9, - and _");
}

void AddNetworkFlags(FlagSet& flags, ServerConfig& config) {
  flags.BeginGroup("Network");
  flags.AddText("--listen", config.listen, "ADDRESS",
                "HOST:PORT or unix:PATH; port 0 picks a free one");
  flags.AddSwitch("--insecure", config.insecure,
                  "Allow --listen beyond this machine without TLS or API keys");
  flags.AddSwitch("--behind-edge", config.behind_edge,
                  "A proxy in front of --listen stops floods of HTTP/2, as "
                  "docker/edge does: no warning at the start, no limit per "
                  "address");
  flags.AddText("--metrics-listen", config.metrics_listen, "ADDRESS",
                "HOST:PORT of the metrics for Prometheus, in plain HTTP; port "
                "0 picks a free one, off means none");
  flags.AddSwitch("--insecure-metrics", config.insecure_metrics,
                  "Allow --metrics-listen beyond this machine");
  flags.AddSwitch("--no-reflection", config.no_reflection,
                  "Do not tell clients by gRPC's reflection which services "
                  "there are");
}

void AddSecurityFlags(FlagSet& flags, ServerConfig& config) {
  flags.BeginGroup("Security");
  flags.AddText("--tls-cert", config.tls_cert, "FILE",
                "PEM file of the certificate and its chain; read again when it "
                "changes, as the other files are");
  flags.AddText("--tls-key", config.tls_key, "FILE",
                "PEM file of its private key, without password");
  flags.AddText("--tls-client-ca", config.tls_client_ca, "FILE",
                "PEM file of authorities: clients must show a certificate of "
                "one of them");
  flags.AddText("--api-keys", config.api_keys, "FILE",
                "File of lines `name tenant role sha256`: calls must come with "
                "one of these keys");
}

void AddNewKeyFlags(CLI::App& app, NewApiKeyRequest& request) {
  CLI::Option* name =
      app.add_option("--new-api-key", request.name,
                     "Make a key of this name: its line for --api-keys goes "
                     "to standard output, the key to standard error, then exit")
          ->check(CLI::Validator(CheckTenantName, "NAME"))
          ->configurable(false)
          ->group("Security");
  app.add_option("--tenant", request.tenant,
                 "Tenant of the new key, whose jobs and meshes it sees")
      ->check(CLI::Validator(CheckTenantName, "NAME"))
      ->needs(name)
      ->configurable(false)
      ->capture_default_str()
      ->group("Security");
}

/// What --role says of a new key.
absl::Status SetKeyRole(const CLI::App& app, const std::string& role,
                        NewApiKeyRequest& request) {
  if (app.count("--role") == 0) return absl::OkStatus();
  for (const char* known : {"read", "submit", "admin"}) {
    if (role == known) {
      request.role = role;
      return absl::OkStatus();
    }
  }
  return WrongValue("--role", role, "read, submit or admin");
}

void AddClusterFlags(FlagSet& flags, ServerConfig& config) {
  flags.BeginGroup("Several processes or machines");
  flags.AddUrl("--store", config.store, "URL",
               "postgresql://USER@HOST:PORT/DATABASE that gateways and "
               "workers share as queue and store, in place of --data-dir; / @ "
               ": of a password in it are written %2F %40 %3A. On a network "
               "that is not trusted add ?sslmode=verify-full&sslrootcert=FILE");
  flags.AddText("--store-password-file", config.store_password_file, "FILE",
                "File whose first line is the password of --store, read at "
                "each new connection; otherwise PGPASSWORD or PGPASSFILE");
  flags.AddText("--blob-dir", config.blob_dir, "FOLDER",
                "With --store: folder that all processes share, such as NFS, "
                "for meshes and results; otherwise they are in the database");
  flags.AddSwitch("--blob-dir-read-only", config.blob_dir_read_only,
                  "New meshes and results go to the database, also with "
                  "--blob-dir");
  flags.AddText("--role", config.role, "ROLE",
                "With --store: gateway takes calls, worker runs jobs, all does "
                "both. With --new-api-key: read, submit or admin");
  flags.AddDuration("--lease", config.lease, ServerConfig::kLease,
                    "How long a worker that says nothing keeps its jobs; then "
                    "others run them");
}

void AddResourceFlags(FlagSet& flags, ServerConfig& config) {
  flags.BeginGroup("Resources");
  flags.AddCount("--workers", config.workers, ServerConfig::kWorkers,
                 "Jobs that run side by side");
  flags.AddCount("--threads-per-job", config.threads_per_job,
                 ServerConfig::kThreadsPerJob,
                 "Threads of one job; 0 shares the cores among the workers");
  flags.AddBytes("--memory-budget", config.memory_budget_bytes,
                 ServerConfig::kMemoryBudgetBytes,
                 "Memory running jobs may reserve together, e.g. 2GiB; 0 is "
                 "80 % of what machine or container has, also the most");
  flags.AddBytes("--max-resident-bytes", config.max_resident_bytes,
                 ServerConfig::kMemoryBudgetBytes,
                 "Memory of the process beyond which jobs are stopped, and the "
                 "process if that does not help; 0 is the budget and what the "
                 "server itself may take");
}

/// Where a service keeps its state: systemd's, or the user's by XDG's rules.
std::string DefaultDataDir() {
  const auto variable = [](const char* name) -> std::string {
    const char* value = std::getenv(name);
    return value == nullptr ? "" : value;
  };
  if (auto given = variable("STATE_DIRECTORY"); !given.empty()) {
    return given;
  }
  if (const auto state = variable("XDG_STATE_HOME"); !state.empty()) {
    return absl::StrCat(state, "/isomatch-server");
  }
  const std::string home = variable("HOME");
  return home.empty() ? "isomatch-server-data"
                      : absl::StrCat(home, "/.local/state/isomatch-server");
}

void AddStorageFlags(FlagSet& flags, ServerConfig& config) {
  flags.BeginGroup("Storage");
  config.data_dir = DefaultDataDir();
  flags.AddText("--data-dir", config.data_dir, "FOLDER",
                "Folder of jobs, meshes and results; they survive restarts");
  flags.AddSwitch("--ephemeral", config.ephemeral,
                  "Keep everything in memory, gone when the server ends");
  flags.AddBytes("--blob-store-bytes", config.blob_store_bytes,
                 ServerConfig::kBlobStoreBytes,
                 "Meshes and results that are kept");
  flags.AddBytes("--prepared-cache-bytes", config.prepared_cache_bytes,
                 ServerConfig::kPreparedCacheBytes,
                 "Prepared meshes in memory, so that one that is matched again "
                 "is not prepared again; 0 for none");
  flags.AddBytes("--prepared-store-bytes", config.prepared_store_bytes,
                 ServerConfig::kPreparedCacheBytes,
                 "The same in --data-dir, of meshes used more than once");
  flags.AddDuration("--job-retention", config.job_retention,
                    ServerConfig::kJobRetention,
                    "How long a job and its result are kept after it ended");
}

void AddLimitFlags(FlagSet& flags, ServerConfig& config) {
  flags.BeginGroup("Limits");
  flags.AddCount("--max-queued-jobs", config.max_queued_jobs,
                 ServerConfig::kMaxQueuedJobs,
                 "Jobs that may wait; more are refused with QUEUE_FULL");
  flags.AddCount("--max-kept-jobs", config.max_kept_jobs,
                 ServerConfig::kMaxKeptJobs,
                 "Ended jobs with a result that are remembered, and as many "
                 "without; the oldest of the tenant that has most goes first");
  flags.AddBytes("--max-request-bytes", config.max_request_bytes,
                 ServerConfig::kMaxRequestBytes,
                 "Largest request, up to half of --blob-store-bytes; larger "
                 "meshes are uploaded");
  flags.AddBytes("--max-mesh-bytes", config.max_mesh_bytes,
                 ServerConfig::kMaxMeshBytes,
                 "Largest uploaded mesh, up to half of --blob-store-bytes");
  flags.AddCount("--max-connections", config.max_connections,
                 ServerConfig::kMaxConnections,
                 "Open connections; 0 is 10000, or what the limit of open "
                 "files has room for; more are closed at once");
  flags.AddCount("--max-connections-per-address",
                 config.max_connections_per_address,
                 ServerConfig::kMaxConnections,
                 "Open connections of one address (IPv6: /64); 0 is an eighth "
                 "of --max-connections; no limit for this machine");
}

void AddTenantFlags(FlagSet& flags, ServerConfig& config) {
  flags.BeginGroup("Limits of one tenant (with --api-keys)");
  flags.AddCount("--max-queued-jobs-per-tenant",
                 config.max_queued_jobs_per_tenant, ServerConfig::kPerTenant,
                 "Jobs that wait, TENANT_QUOTA; 0 is half of all");
  flags.AddCount("--max-running-jobs-per-tenant",
                 config.max_running_jobs_per_tenant, ServerConfig::kPerTenant,
                 "Jobs that run, with --store at all processes; 0 is three "
                 "quarters of --workers, rounded up, with --store no limit");
  flags.AddBytes(
      "--max-bytes-per-tenant", config.max_bytes_per_tenant,
      ServerConfig::kMaxTenantBytes,
      "Meshes, requests and results, STORAGE_QUOTA for what comes on "
      "top; 0 is half of --blob-store-bytes. At least twice "
      "--max-mesh-bytes and --max-request-bytes");
  flags.AddCount("--max-kept-jobs-per-tenant", config.max_kept_jobs_per_tenant,
                 ServerConfig::kPerTenant,
                 "Ended jobs that are remembered; 0 is half of all");
  flags.AddCount("--max-uploads-per-tenant", config.max_uploads_per_tenant,
                 ServerConfig::kPerTenant,
                 "Uploads at a time, UPLOAD_QUOTA; 0 is 16");
  flags.AddCount("--max-requests-per-tenant", config.max_requests_per_tenant,
                 ServerConfig::kPerTenant,
                 "CreateJob calls that wait to be read, TENANT_QUOTA; 0 is 32");
  flags.AddCount("--max-priority", config.max_priority,
                 ServerConfig::kMaxPriority,
                 "How far priorities count among tenants, where the line of a "
                 "key has no max-priority=N");
}

void AddOperationFlags(FlagSet& flags, ServerConfig& config) {
  flags.BeginGroup("Operation");
  flags.AddDuration(
      "--max-run-time", config.max_run_time, ServerConfig::kMaxRunTime,
      "Most time that a job may run, whatever it asks for; 0 for no limit");
  flags.AddDuration("--unresponsive-grace", config.unresponsive_grace,
                    ServerConfig::kUnresponsiveGrace,
                    "What a job may take to stop once it was asked to; then "
                    "its worker is given up");
  flags.AddDuration("--drain-timeout", config.drain_timeout,
                    ServerConfig::kDrainTimeout,
                    "What running jobs get after SIGTERM, e.g. 30s or 5m");
  flags.AddDuration("--watch-heartbeat", config.watch_heartbeat,
                    ServerConfig::kStreamTimes,
                    "A watcher hears from its job at least this often");
  flags.AddDuration("--upload-idle-timeout", config.upload_idle_timeout,
                    ServerConfig::kStreamTimes,
                    "An upload that brings less than 1 KiB a second over this "
                    "time, or too little to be whole within an hour, is "
                    "dropped");
  flags.AddDuration("--partial-upload-kept", config.partial_upload_kept,
                    ServerConfig::kPartialUploadKept,
                    "An upload that broke off can go on within this time");
  flags.AddDuration("--unwatched-grace", config.unwatched_grace,
                    ServerConfig::kStreamTimes,
                    "A job that asks to be cancelled when nobody watches it is "
                    "cancelled after this long");
  flags.AddText("--log-level", config.log_level, "LEVEL",
                "trace, debug, info, warn, error, critical or off");
  flags.AddText("--log-format", config.log_format, "FORMAT",
                "text, or json: one object a line");
}

/// Flags that do something else than serve.
struct Actions {
  bool print_config = false;
  CLI::App* migrate = nullptr;
  /// Whose health to ask; empty for the server that the flags start.
  std::optional<std::string> health_address;
};

/// What its --help says of flags: those that it uses, which are the server's.
std::string MigrateFooter(const CLI::App& app) {
  std::string text = "\nFlags of the server that say where:\n";
  for (const char* flag : {"--store", "--store-password-file"}) {
    const CLI::Option& option = *app.get_option(flag);
    absl::StrAppend(&text, "  ", flag, " ", option.get_type_name(),
                    " (Env:", option.get_envname(), ")\n      ",
                    option.get_description(), "\n");
  }
  absl::StrAppend(&text,
                  "\nExample:\n  isomatch-server migrate --store "
                  "postgresql://isomatch@db/isomatch");
  return text;
}

void AddActions(CLI::App& app, Actions& actions) {
  app.set_version_flag("--version", absl::StrCat("isomatch-server ", kVersion));
  actions.migrate =
      app.add_subcommand("migrate",
                         "Makes or updates the tables of --store, then exits")
          ->fallthrough();
  actions.migrate->footer(MigrateFooter(app));
  app.add_flag("--print-config", actions.print_config,
               "Prints the values of all flags, as a file for --config")
      ->configurable(false);
  app.add_option(
         "--health",
         [&actions](const CLI::results_t& results) {
           actions.health_address = results.front();
           return true;
         },
         "Asks the server at ADDRESS, by default that of --listen, whether it "
         "serves, for 2 s at most; exits with 0 if it does. Whether the "
         "database of --store answers, /readyz of --metrics-listen says")
      ->type_name("[ADDRESS]")
      ->type_size(1)
      ->expected(0, 1)
      ->configurable(false);
}

/// Which server --health is to ask.
absl::StatusOr<std::string> HealthAddress(const std::string& given,
                                          const ServerConfig& config) {
  if (given.empty() && config.role == "worker") {
    const std::string& metrics = config.metrics_listen;
    return absl::InvalidArgumentError(absl::StrCat(
        "--health with --role = worker, which takes no calls; ",
        metrics == "off"
            ? "its --metrics-listen, which is off, would have /readyz"
            : absl::StrCat("ask http://", ProbeAddress(metrics), "/readyz")));
  }
  std::string address = given.empty() ? ProbeAddress(config.listen) : given;
  ISOMATCH_RETURN_IF_ERROR(CheckServerAddress("--health", address));
  return address;
}

absl::Status Finish(const Actions& actions, ServerCommand& command) {
  if (command.config.role == "worker") command.config.listen = "";
  ISOMATCH_RETURN_IF_ERROR(command.config.Validate());
  command.migrate = actions.migrate->parsed();
  if (command.migrate && !command.config.is_shared()) {
    return absl::InvalidArgumentError(
        "migrate without --store, expected the database whose tables to bring "
        "up to date; a --data-dir is brought up to date by itself");
  }
  if (!actions.health_address) return absl::OkStatus();
  ISOMATCH_ASSIGN_OR_RETURN(
      command.health_address,
      HealthAddress(*actions.health_address, command.config));
  return absl::OkStatus();
}

/// Whether the command line itself has a flag: files and the environment may be
/// those of several processes.
bool IsArgument(const std::string& flag, int argc, const char* const* argv) {
  return std::any_of(argv + 1, argv + argc, [&](absl::string_view argument) {
    return argument == flag || absl::StartsWith(argument, flag + "=");
  });
}

/// What depends on whether a flag is given.
absl::Status CheckGiven(const CLI::App& app, bool has_data_dir_argument,
                        ServerConfig& config) {
  if (app.count("--max-mesh-bytes") == 0) {
    config.max_mesh_bytes =
        std::min(config.max_mesh_bytes, config.blob_store_bytes / 2);
  }
  if (!has_data_dir_argument || !config.is_shared()) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat("--data-dir = ", config.data_dir,
                   " with --store, expected one of them: the database keeps "
                   "everything"));
}

}  // namespace

std::optional<int> ParseServerFlags(int argc, const char* const* argv,
                                    ServerCommand& command) {
  constexpr int kWrongFlags = 2;
  CLI::App app(kDescription, "isomatch-server");
  app.footer(kFooter);
  FlagSet flags(app);
  AddNetworkFlags(flags, command.config);
  AddSecurityFlags(flags, command.config);
  NewApiKeyRequest new_key;
  AddNewKeyFlags(app, new_key);
  AddResourceFlags(flags, command.config);
  AddStorageFlags(flags, command.config);
  AddClusterFlags(flags, command.config);
  AddLimitFlags(flags, command.config);
  AddTenantFlags(flags, command.config);
  AddOperationFlags(flags, command.config);
  Actions actions;
  AddActions(app, actions);
  try {
    app.parse(argc, argv);
  } catch (const CLI::FileError& error) {
    std::cerr << "isomatch-server: --config: " << error.what() << "\n";
    return kWrongFlags;
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : kWrongFlags;
  }
  if (!new_key.name.empty()) {
    if (const absl::Status role = SetKeyRole(app, command.config.role, new_key);
        !role.ok()) {
      std::cerr << "isomatch-server: " << role.message() << "\n";
      return kWrongFlags;
    }
    return PrintNewApiKey(new_key, std::cout, std::cerr);
  }
  absl::Status finished =
      CheckGiven(app, IsArgument("--data-dir", argc, argv), command.config);
  if (finished.ok()) finished = Finish(actions, command);
  if (!finished.ok()) {
    std::cerr << "isomatch-server: " << finished.message() << "\n";
    return kWrongFlags;
  }
  if (!actions.print_config) return std::nullopt;
  std::cout << flags.Print();
  return 0;
}

}  // namespace isomatch
