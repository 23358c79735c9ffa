#include "server/server_config.h"

#include <arpa/inet.h>

#include <array>
#include <utility>
#include <vector>

#include "absl/algorithm/container.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

constexpr std::int64_t kMiB = std::int64_t{1} << 20;

absl::Status CheckRange(absl::string_view field, std::int64_t value,
                        std::int64_t least, std::int64_t most) {
  if (value >= least && value <= most) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat(field, " = ", value, ", expected ", least, " to ", most));
}

absl::Status CheckDuration(absl::string_view field, absl::Duration value,
                           absl::Duration least, absl::Duration most) {
  if (value >= least && value <= most) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat(
      field, " = ", absl::FormatDuration(value), ", expected ",
      absl::FormatDuration(least), " to ", absl::FormatDuration(most)));
}

bool IsLoopback(const std::string& host) {
  in_addr address = {};
  // Not every name that begins with 127. is such an address.
  return host == "localhost" || host == "[::1]" ||
         (absl::StartsWith(host, "127.") &&
          inet_pton(AF_INET, host.c_str(), &address) == 1);
}

absl::Status CheckListen(const std::string& listen) {
  constexpr int kMaxPort = 65535;
  if (listen.empty() || absl::StartsWith(listen, "unix:")) {
    return absl::OkStatus();
  }
  const size_t colon = listen.rfind(':');
  int port = -1;
  if (colon != std::string::npos && colon != 0 &&
      absl::SimpleAtoi(listen.substr(colon + 1), &port) && port >= 0 &&
      port <= kMaxPort) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(
      absl::StrCat("--listen = ", listen,
                   ", expected HOST:PORT, e.g. 127.0.0.1:7443, or unix:PATH"));
}

absl::Status CheckTls(const ServerConfig& config) {
  if (!config.tls_cert.empty() && config.tls_key.empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat("--tls-cert = ", config.tls_cert,
                     " without --tls-key, expected the file of its key too"));
  }
  if (!config.tls_cert.empty()) return absl::OkStatus();
  for (const auto& [field, path] :
       {std::pair("--tls-key", &config.tls_key),
        std::pair("--tls-client-ca", &config.tls_client_ca)}) {
    if (path->empty()) continue;
    return absl::InvalidArgumentError(
        absl::StrCat(field, " = ", *path,
                     " without --tls-cert, expected the file of the server's "
                     "certificate too"));
  }
  return absl::OkStatus();
}

/// REQUIRES: CheckListen(config.listen) is OK.
absl::Status CheckExposure(const ServerConfig& config) {
  const std::string& listen = config.listen;
  if (config.insecure || listen.empty() || absl::StartsWith(listen, "unix:") ||
      IsLoopback(listen.substr(0, listen.rfind(':')))) {
    return absl::OkStatus();
  }
  std::vector<absl::string_view> missing;
  if (config.tls_cert.empty()) missing.push_back("TLS (--tls-cert, --tls-key)");
  if (config.api_keys.empty()) missing.push_back("API keys (--api-keys)");
  if (missing.empty()) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat(
      "--listen = ", listen, " can be reached by other machines without ",
      absl::StrJoin(missing, " and without "),
      ". Expected both, or a loopback address such as 127.0.0.1:7443, or "
      "--insecure if the network is trusted or a TLS proxy stands in front"));
}

absl::Status CheckLogLevel(const std::string& level) {
  constexpr std::array<absl::string_view, 7> kLevels = {
      "trace", "debug", "info", "warn", "error", "critical", "off"};
  if (absl::c_linear_search(kLevels, level)) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat(
      "--log-level = ", level,
      ", expected trace, debug, info, warn, error, critical or off"));
}

}  // namespace

absl::Status ServerConfig::Validate() const {
  ISOMATCH_RETURN_IF_ERROR(CheckListen(listen));
  ISOMATCH_RETURN_IF_ERROR(CheckTls(*this));
  ISOMATCH_RETURN_IF_ERROR(CheckExposure(*this));
  ISOMATCH_RETURN_IF_ERROR(CheckRange("--workers", workers, 1, 256));
  ISOMATCH_RETURN_IF_ERROR(
      CheckRange("--threads-per-job", threads_per_job, 0, 1024));
  constexpr std::int64_t kMostMemory = std::int64_t{1} << 50;
  ISOMATCH_RETURN_IF_ERROR(
      CheckRange("--memory-budget", memory_budget_bytes, 0, kMostMemory));
  ISOMATCH_RETURN_IF_ERROR(
      CheckRange("blob_store_bytes", blob_store_bytes, 16 * kMiB, kMostMemory));
  ISOMATCH_RETURN_IF_ERROR(
      CheckRange("--max-queued-jobs", max_queued_jobs, 1, 100'000));
  ISOMATCH_RETURN_IF_ERROR(CheckRange("--max-queued-jobs-per-tenant",
                                      max_queued_jobs_per_tenant, 0, 100'000));
  ISOMATCH_RETURN_IF_ERROR(CheckRange("--max-request-bytes", max_request_bytes,
                                      2 * kMiB, blob_store_bytes / 2));
  ISOMATCH_RETURN_IF_ERROR(
      CheckRange("max_mesh_bytes", max_mesh_bytes, 1, blob_store_bytes / 2));
  ISOMATCH_RETURN_IF_ERROR(
      CheckRange("max_kept_jobs", max_kept_jobs, 1, 1'000'000));
  ISOMATCH_RETURN_IF_ERROR(CheckDuration(
      "--drain-timeout", drain_timeout, absl::ZeroDuration(), absl::Hours(24)));
  ISOMATCH_RETURN_IF_ERROR(CheckDuration("--job-retention", job_retention,
                                         absl::Minutes(1),
                                         absl::Hours(24 * 3652)));
  ISOMATCH_RETURN_IF_ERROR(CheckDuration("watch_heartbeat", watch_heartbeat,
                                         absl::Milliseconds(10),
                                         absl::Hours(1)));
  ISOMATCH_RETURN_IF_ERROR(
      CheckDuration("upload_idle_timeout", upload_idle_timeout,
                    absl::Milliseconds(10), absl::Hours(1)));
  return CheckLogLevel(log_level);
}

}  // namespace isomatch
