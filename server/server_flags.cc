#include "server/server_flags.h"

#include <cstdlib>
#include <iostream>
#include <string>

#include <CLI/CLI.hpp>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "core/base/version.h"
#include "server/jobs/caller.h"
#include "server/new_api_key.h"

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
  isomatch match --server 127.0.0.1:7443 x.off y.off -o map.txt
      Sends a first job.

SIGTERM or SIGINT: no new jobs, running ones get --drain-timeout, exit 0.
A second signal exits at once. Exit status: 2 wrong flags, 1 other errors.)";

/// An option such as 30, 30s or 5m.
CLI::Option* AddDurationOption(CLI::App& app, const std::string& name,
                               absl::Duration& duration,
                               const std::string& description) {
  const auto parse = [&duration, name](const std::string& text) {
    const bool unit = !text.empty() && absl::ascii_isalpha(text.back());
    const std::string with_unit = unit ? text : absl::StrCat(text, "s");
    if (!absl::ParseDuration(with_unit, &duration)) {
      throw CLI::ValidationError(name, text + ", expected e.g. 30s or 5m");
    }
  };
  return app.add_option_function<std::string>(name, parse, description)
      ->default_str(absl::FormatDuration(duration));
}

/// What CLI11 tells the user about a name that is none; empty when it is.
std::string CheckTenantName(const std::string& name) {
  if (IsTenantName(name)) return "";
  return absl::StrCat("'", name, "', expected 1 to 63 of a-z, 0-9, - and _");
}

void AddNetworkFlags(CLI::App& app, ServerConfig& config) {
  app.add_option("--listen", config.listen,
                 "HOST:PORT or unix:PATH; port 0 picks a free one")
      ->capture_default_str()
      ->group("Network");
  app.add_flag("--insecure", config.insecure,
               "Allow --listen beyond this machine without TLS or API keys")
      ->group("Network");
}

void AddSecurityFlags(CLI::App& app, ServerConfig& config) {
  app.add_option("--tls-cert", config.tls_cert,
                 "PEM file of the certificate and its chain; read again when "
                 "it changes, as the other files are")
      ->group("Security");
  app.add_option("--tls-key", config.tls_key,
                 "PEM file of its private key, without password")
      ->group("Security");
  app.add_option("--tls-client-ca", config.tls_client_ca,
                 "PEM file of authorities: clients must show a certificate of "
                 "one of them")
      ->group("Security");
  app.add_option("--api-keys", config.api_keys,
                 "File of lines `name tenant role sha256`: calls must come "
                 "with one of these keys")
      ->group("Security");
}

void AddNewKeyFlags(CLI::App& app, NewApiKeyRequest& request) {
  CLI::Option* name =
      app.add_option("--new-api-key", request.name,
                     "Make a key of this name: its line for --api-keys goes "
                     "to standard output, the key to standard error, then exit")
          ->check(CLI::Validator(CheckTenantName, "NAME"))
          ->group("Security");
  app.add_option("--tenant", request.tenant,
                 "Of the new key: whose jobs and meshes it sees")
      ->check(CLI::Validator(CheckTenantName, "NAME"))
      ->needs(name)
      ->capture_default_str()
      ->group("Security");
  app.add_option("--role", request.role,
                 "Of the new key: read, submit or admin")
      ->check(CLI::IsMember({"read", "submit", "admin"}))
      ->needs(name)
      ->capture_default_str()
      ->group("Security");
}

void AddResourceFlags(CLI::App& app, ServerConfig& config) {
  app.add_option("--workers", config.workers, "Jobs that run side by side")
      ->capture_default_str()
      ->group("Resources");
  app.add_option("--threads-per-job", config.threads_per_job,
                 "Threads of one job; 0 shares the cores among the workers")
      ->capture_default_str()
      ->group("Resources");
  app.add_option("--memory-budget", config.memory_budget_bytes,
                 "Memory running jobs may reserve together, e.g. 2GiB; 0 is "
                 "80 % of what machine or container has, also the most")
      ->transform(CLI::AsSizeValue(/*kb_is_1000=*/true))
      ->capture_default_str()
      ->group("Resources");
}

/// Where a service keeps its state: systemd's, or the user's by XDG's rules.
std::string DefaultDataDir() {
  const auto variable = [](const char* name) -> std::string {
    const char* value = std::getenv(name);
    return value == nullptr ? "" : value;
  };
  if (const auto given = variable("STATE_DIRECTORY"); !given.empty()) {
    return given;
  }
  if (const auto state = variable("XDG_STATE_HOME"); !state.empty()) {
    return absl::StrCat(state, "/isomatch-server");
  }
  const std::string home = variable("HOME");
  return home.empty() ? "isomatch-server-data"
                      : absl::StrCat(home, "/.local/state/isomatch-server");
}

void AddStorageFlags(CLI::App& app, ServerConfig& config) {
  app.add_option("--data-dir", config.data_dir,
                 "Folder of jobs, meshes and results; they survive restarts")
      ->default_val(DefaultDataDir())
      ->group("Storage");
  app.add_flag_callback(
         "--ephemeral", [&config] { config.data_dir = ""; },
         "Keep everything in memory, gone when the server ends")
      ->excludes("--data-dir")
      ->group("Storage");
  AddDurationOption(app, "--job-retention", config.job_retention,
                    "How long a job and its result are kept after it ended")
      ->group("Storage");
}

void AddLimitFlags(CLI::App& app, ServerConfig& config) {
  app.add_option("--max-queued-jobs", config.max_queued_jobs,
                 "Jobs that may wait; more are refused with QUEUE_FULL")
      ->capture_default_str()
      ->group("Limits");
  app.add_option("--max-request-bytes", config.max_request_bytes,
                 "Largest request, e.g. 8MiB; larger meshes are uploaded")
      ->transform(CLI::AsSizeValue(/*kb_is_1000=*/true))
      ->capture_default_str()
      ->group("Limits");
}

void AddOperationFlags(CLI::App& app, ServerConfig& config) {
  AddDurationOption(app, "--drain-timeout", config.drain_timeout,
                    "What running jobs get after SIGTERM, e.g. 30s or 5m")
      ->group("Operation");
  app.add_option("--log-level", config.log_level,
                 "trace, debug, info, warn, error, critical or off")
      ->capture_default_str()
      ->group("Operation");
  app.set_version_flag("--version", absl::StrCat("isomatch-server ", kVersion));
}

}  // namespace

std::optional<int> ParseServerFlags(int argc, const char* const* argv,
                                    ServerConfig& config) {
  constexpr int kWrongFlags = 2;
  CLI::App app(kDescription, "isomatch-server");
  app.footer(kFooter);
  NewApiKeyRequest new_key;
  AddNetworkFlags(app, config);
  AddSecurityFlags(app, config);
  AddNewKeyFlags(app, new_key);
  AddResourceFlags(app, config);
  AddStorageFlags(app, config);
  AddLimitFlags(app, config);
  AddOperationFlags(app, config);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : kWrongFlags;
  }
  if (!new_key.name.empty()) {
    return PrintNewApiKey(new_key, std::cout, std::cerr);
  }
  const absl::Status valid = config.Validate();
  if (valid.ok()) return std::nullopt;
  std::cerr << "isomatch-server: " << valid.message() << "\n";
  return kWrongFlags;
}

}  // namespace isomatch
