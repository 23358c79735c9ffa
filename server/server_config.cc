#include "server/server_config.h"

#include <algorithm>
#include <optional>
#include <utility>
#include <vector>

#include "absl/algorithm/container.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "core/base/host_port.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

absl::Status CheckListen(const std::string& listen) {
  if (listen.empty()) return absl::OkStatus();
  return CheckServerAddress("--listen", listen);
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
  if (config.insecure || !config.is_exposed()) return absl::OkStatus();
  std::vector<absl::string_view> missing;
  if (config.tls_cert.empty()) missing.push_back("TLS (--tls-cert, --tls-key)");
  if (config.api_keys.empty()) missing.push_back("API keys (--api-keys)");
  if (missing.empty()) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat(
      "--listen = ", config.listen,
      " can be reached by other machines without ",
      absl::StrJoin(missing, " and without "),
      ". Expected both, or a loopback address such as 127.0.0.1:7443, or "
      "--insecure if the network is trusted or a TLS proxy stands in front"));
}

absl::Status CheckMetricsListen(const ServerConfig& config) {
  const std::string& listen = config.metrics_listen;
  if (listen == "off") return absl::OkStatus();
  // Debian's civetweb, which serves the metrics, knows no IPv6.
  const std::optional<HostPort> parts = ParseHostPort(listen);
  if (!parts || absl::StartsWith(listen, "[")) {
    return WrongValue("--metrics-listen", listen,
                      "HOST:PORT of IPv4, e.g. 127.0.0.1:7444, or off");
  }
  if (config.insecure || config.insecure_metrics || IsLoopback(parts->host)) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(absl::StrCat(
      "--metrics-listen = ", listen,
      " can be read by other machines without TLS or keys. Expected a loopback "
      "address such as 127.0.0.1:7444, off, or --insecure-metrics if whoever "
      "reaches it may read it"));
}

absl::Status CheckWord(absl::string_view field, const std::string& word,
                       const std::vector<std::string>& words) {
  if (absl::c_linear_search(words, word)) return absl::OkStatus();
  return WrongValue(field, word, absl::StrJoin(words, ", "));
}

/// What must not be more than half of the blob store, since it passes there.
absl::Status CheckBytesOfHalf(absl::string_view field, std::int64_t value,
                              const IntRange& range,
                              std::int64_t blob_store_bytes) {
  return CheckBytes(field, value,
                    {range.least, std::min(range.most, blob_store_bytes / 2)});
}

}  // namespace

absl::Status CheckServerAddress(absl::string_view field,
                                const std::string& address) {
  if (absl::StartsWith(address, "unix:") || ParseHostPort(address)) {
    return absl::OkStatus();
  }
  return WrongValue(field, address,
                    "HOST:PORT, e.g. 127.0.0.1:7443, or unix:PATH");
}

bool ServerConfig::is_exposed() const {
  return !listen.empty() && !IsLoopbackAddress(listen);
}

absl::Status ServerConfig::Validate() const {
  ISOMATCH_RETURN_IF_ERROR(CheckListen(listen));
  ISOMATCH_RETURN_IF_ERROR(CheckTls(*this));
  ISOMATCH_RETURN_IF_ERROR(CheckExposure(*this));
  ISOMATCH_RETURN_IF_ERROR(CheckMetricsListen(*this));
  ISOMATCH_RETURN_IF_ERROR(CheckCount("--workers", workers, kWorkers));
  ISOMATCH_RETURN_IF_ERROR(
      CheckCount("--threads-per-job", threads_per_job, kThreadsPerJob));
  ISOMATCH_RETURN_IF_ERROR(
      CheckBytes("--memory-budget", memory_budget_bytes, kMemoryBudgetBytes));
  ISOMATCH_RETURN_IF_ERROR(CheckBytes("--max-resident-bytes",
                                      max_resident_bytes, kMemoryBudgetBytes));
  ISOMATCH_RETURN_IF_ERROR(
      CheckBytes("--blob-store-bytes", blob_store_bytes, kBlobStoreBytes));
  ISOMATCH_RETURN_IF_ERROR(CheckBytes(
      "--prepared-cache-bytes", prepared_cache_bytes, kPreparedCacheBytes));
  ISOMATCH_RETURN_IF_ERROR(CheckBytes(
      "--prepared-store-bytes", prepared_store_bytes, kPreparedCacheBytes));
  ISOMATCH_RETURN_IF_ERROR(
      CheckCount("--max-queued-jobs", max_queued_jobs, kMaxQueuedJobs));
  for (const auto& [field, value] :
       {std::pair("--max-queued-jobs-per-tenant", max_queued_jobs_per_tenant),
        std::pair("--max-running-jobs-per-tenant", max_running_jobs_per_tenant),
        std::pair("--max-kept-jobs-per-tenant", max_kept_jobs_per_tenant),
        std::pair("--max-uploads-per-tenant", max_uploads_per_tenant),
        std::pair("--max-requests-per-tenant", max_requests_per_tenant)}) {
    ISOMATCH_RETURN_IF_ERROR(CheckCount(field, value, kPerTenant));
  }
  ISOMATCH_RETURN_IF_ERROR(
      CheckCount("--max-priority", max_priority, kMaxPriority));
  ISOMATCH_RETURN_IF_ERROR(CheckBytesOfHalf("--max-request-bytes",
                                            max_request_bytes, kMaxRequestBytes,
                                            blob_store_bytes));
  ISOMATCH_RETURN_IF_ERROR(CheckBytesOfHalf("--max-mesh-bytes", max_mesh_bytes,
                                            kMaxMeshBytes, blob_store_bytes));
  if (max_bytes_per_tenant != 0) {
    // Both meshes of a job, and its request.
    ISOMATCH_RETURN_IF_ERROR(CheckBytes(
        "--max-bytes-per-tenant", max_bytes_per_tenant,
        {2 * max_mesh_bytes + max_request_bytes, kMaxTenantBytes.most}));
  }
  ISOMATCH_RETURN_IF_ERROR(
      CheckCount("--max-kept-jobs", max_kept_jobs, kMaxKeptJobs));
  ISOMATCH_RETURN_IF_ERROR(
      CheckDuration("--max-run-time", max_run_time, kMaxRunTime));
  ISOMATCH_RETURN_IF_ERROR(CheckDuration(
      "--unresponsive-grace", unresponsive_grace, kUnresponsiveGrace));
  ISOMATCH_RETURN_IF_ERROR(
      CheckCount("--max-connections", max_connections, kMaxConnections));
  ISOMATCH_RETURN_IF_ERROR(CheckCount("--max-connections-per-address",
                                      max_connections_per_address,
                                      kMaxConnections));
  ISOMATCH_RETURN_IF_ERROR(
      CheckDuration("--drain-timeout", drain_timeout, kDrainTimeout));
  ISOMATCH_RETURN_IF_ERROR(
      CheckDuration("--job-retention", job_retention, kJobRetention));
  ISOMATCH_RETURN_IF_ERROR(
      CheckDuration("--watch-heartbeat", watch_heartbeat, kStreamTimes));
  ISOMATCH_RETURN_IF_ERROR(CheckDuration("--upload-idle-timeout",
                                         upload_idle_timeout, kStreamTimes));
  ISOMATCH_RETURN_IF_ERROR(CheckDuration(
      "--partial-upload-kept", partial_upload_kept, kPartialUploadKept));
  ISOMATCH_RETURN_IF_ERROR(
      CheckDuration("--unwatched-grace", unwatched_grace, kStreamTimes));
  ISOMATCH_RETURN_IF_ERROR(CheckWord(
      "--log-level", log_level,
      {"trace", "debug", "info", "warn", "error", "critical", "off"}));
  return CheckWord("--log-format", log_format, {"text", "json"});
}

}  // namespace isomatch
