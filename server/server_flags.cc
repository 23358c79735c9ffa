#include "server/server_flags.h"

#include <iostream>
#include <string>

#include <CLI/CLI.hpp>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "core/base/version.h"

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
  isomatch-server --listen 0.0.0.0:7443 --insecure
      Open to the network, unencrypted: put a TLS proxy in front.
  isomatch match --server 127.0.0.1:7443 x.off y.off -o map.txt
      Sends a first job.

SIGTERM or SIGINT: no new jobs, running ones get --drain-timeout, exit 0.
A second signal exits at once. Exit status: 2 wrong flags, 1 other errors.)";

absl::Duration ParseSeconds(const std::string& text) {
  const bool unit = !text.empty() && absl::ascii_isalpha(text.back());
  absl::Duration duration;
  if (!absl::ParseDuration(unit ? text : absl::StrCat(text, "s"), &duration)) {
    throw CLI::ValidationError("--drain-timeout",
                               text + ", expected e.g. 30s or 5m");
  }
  return duration;
}

void AddNetworkFlags(CLI::App& app, ServerConfig& config) {
  app.add_option("--listen", config.listen,
                 "HOST:PORT or unix:PATH; port 0 picks a free one")
      ->capture_default_str()
      ->group("Network");
  app.add_flag("--insecure", config.insecure,
               "Allow --listen beyond this machine without encryption")
      ->group("Network");
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
  app.add_option_function<std::string>(
         "--drain-timeout",
         [&config](const std::string& text) {
           config.drain_timeout = ParseSeconds(text);
         },
         "What running jobs get after SIGTERM, e.g. 30s or 5m")
      ->default_str(absl::FormatDuration(config.drain_timeout))
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
  AddNetworkFlags(app, config);
  AddResourceFlags(app, config);
  AddLimitFlags(app, config);
  AddOperationFlags(app, config);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : kWrongFlags;
  }
  const absl::Status valid = config.Validate();
  if (valid.ok()) return std::nullopt;
  std::cerr << "isomatch-server: " << valid.message() << "\n";
  return kWrongFlags;
}

}  // namespace isomatch
