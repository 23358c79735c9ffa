#include "server/config/server_config.h"

#include <algorithm>
#include <cstdint>
#include <initializer_list>
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

/// What would be ignored without --store.
absl::Status CheckNoStore(const ServerConfig& config) {
  const auto refused = [](absl::string_view field, absl::string_view value,
                          absl::string_view why) {
    return absl::InvalidArgumentError(
        absl::StrCat(field, " = ", value, " without --store", why));
  };
  constexpr absl::string_view kExpected =
      ", expected the database that gateways and workers share";
  if (!config.blob_dir.empty()) {
    return refused("--blob-dir", config.blob_dir, "; --data-dir has its own");
  }
  if (!config.store_password_file.empty()) {
    return refused("--store-password-file", config.store_password_file,
                   kExpected);
  }
  if (config.role != "all") return refused("--role", config.role, kExpected);
  if (config.lease != ServerConfig().lease) {
    return refused("--lease", absl::FormatDuration(config.lease), kExpected);
  }
  return absl::OkStatus();
}

absl::Status CheckStore(const ServerConfig& config) {
  ISOMATCH_RETURN_IF_ERROR(
      CheckWord("--role", config.role, {"all", "gateway", "worker"}));
  if (config.blob_dir_read_only && config.blob_dir.empty()) {
    return absl::InvalidArgumentError(
        "--blob-dir-read-only without --blob-dir");
  }
  if (!config.is_shared()) return CheckNoStore(config);
  if (config.ephemeral) {
    return absl::InvalidArgumentError(
        "--ephemeral with --store, expected one of them: the database keeps "
        "everything");
  }
  const bool is_url = absl::StartsWith(config.store, "postgresql://") ||
                      absl::StartsWith(config.store, "postgres://");
  if (!is_url) {
    // Not the value: it may have a password.
    return WrongValue("--store", "...", "postgresql://USER@HOST:PORT/DATABASE");
  }
  return CheckDuration("--lease", config.lease, ServerConfig::kLease);
}

/// What must not be more than half of the blob store, since it passes there.
absl::Status CheckBytesOfHalf(absl::string_view field, std::int64_t value,
                              const IntRange& range,
                              std::int64_t blob_store_bytes) {
  const std::int64_t half = blob_store_bytes / 2;
  absl::Status status =
      CheckBytes(field, value, {range.least, std::min(range.most, half)});
  if (status.ok() || half >= range.most) return status;
  return absl::InvalidArgumentError(absl::StrCat(
      status.message(),
      " (half of --blob-store-bytes = ", FormatBytes(blob_store_bytes), ")"));
}

/// What a flag says, and what it may.
template <typename Value, typename Range>
struct Setting {
  absl::string_view field;
  Value value;
  Range range;
};

/// The first error of `check`.
template <typename Value, typename Range>
absl::Status CheckEach(absl::Status (*check)(absl::string_view, Value,
                                             const Range&),
                       std::initializer_list<Setting<Value, Range>> settings) {
  for (const Setting<Value, Range>& setting : settings) {
    ISOMATCH_RETURN_IF_ERROR(
        check(setting.field, setting.value, setting.range));
  }
  return absl::OkStatus();
}

absl::Status CheckCounts(const ServerConfig& config) {
  using Config = ServerConfig;
  return CheckEach<std::int64_t, IntRange>(
      CheckCount,
      {{"--workers", config.workers, Config::kWorkers},
       {"--threads-per-job", config.threads_per_job, Config::kThreadsPerJob},
       {"--max-queued-jobs", config.max_queued_jobs, Config::kMaxQueuedJobs},
       {"--max-queued-jobs-per-tenant", config.max_queued_jobs_per_tenant,
        Config::kPerTenant},
       {"--max-running-jobs-per-tenant", config.max_running_jobs_per_tenant,
        Config::kPerTenant},
       {"--max-kept-jobs-per-tenant", config.max_kept_jobs_per_tenant,
        Config::kPerTenant},
       {"--max-uploads-per-tenant", config.max_uploads_per_tenant,
        Config::kPerTenant},
       {"--max-requests-per-tenant", config.max_requests_per_tenant,
        Config::kPerTenant},
       {"--max-priority", config.max_priority, Config::kMaxPriority},
       {"--max-kept-jobs", config.max_kept_jobs, Config::kMaxKeptJobs},
       {"--max-connections", config.max_connections, Config::kMaxConnections},
       {"--max-connections-per-address", config.max_connections_per_address,
        Config::kMaxConnections}});
}

absl::Status CheckSizes(const ServerConfig& config) {
  using Config = ServerConfig;
  ISOMATCH_RETURN_IF_ERROR((CheckEach<std::int64_t, IntRange>(
      CheckBytes,
      {{"--memory-budget", config.memory_budget_bytes,
        Config::kMemoryBudgetBytes},
       {"--max-resident-bytes", config.max_resident_bytes,
        Config::kMemoryBudgetBytes},
       {"--blob-store-bytes", config.blob_store_bytes, Config::kBlobStoreBytes},
       {"--prepared-cache-bytes", config.prepared_cache_bytes,
        Config::kPreparedCacheBytes},
       {"--prepared-store-bytes", config.prepared_store_bytes,
        Config::kPreparedCacheBytes}})));
  ISOMATCH_RETURN_IF_ERROR(
      CheckBytesOfHalf("--max-request-bytes", config.max_request_bytes,
                       Config::kMaxRequestBytes, config.blob_store_bytes));
  ISOMATCH_RETURN_IF_ERROR(
      CheckBytesOfHalf("--max-mesh-bytes", config.max_mesh_bytes,
                       Config::kMaxMeshBytes, config.blob_store_bytes));
  if (config.max_bytes_per_tenant == 0) return absl::OkStatus();
  // Both meshes of a job, and its request.
  return CheckBytes("--max-bytes-per-tenant", config.max_bytes_per_tenant,
                    {2 * config.max_mesh_bytes + config.max_request_bytes,
                     Config::kMaxTenantBytes.most});
}

absl::Status CheckTimes(const ServerConfig& config) {
  using Config = ServerConfig;
  return CheckEach<absl::Duration, DurationRange>(
      CheckDuration,
      {{"--max-run-time", config.max_run_time, Config::kMaxRunTime},
       {"--unresponsive-grace", config.unresponsive_grace,
        Config::kUnresponsiveGrace},
       {"--drain-timeout", config.drain_timeout, Config::kDrainTimeout},
       {"--job-retention", config.job_retention, Config::kJobRetention},
       {"--watch-heartbeat", config.watch_heartbeat, Config::kStreamTimes},
       {"--upload-idle-timeout", config.upload_idle_timeout,
        Config::kStreamTimes},
       {"--partial-upload-kept", config.partial_upload_kept,
        Config::kPartialUploadKept},
       {"--unwatched-grace", config.unwatched_grace, Config::kStreamTimes}});
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
  ISOMATCH_RETURN_IF_ERROR(CheckStore(*this));
  ISOMATCH_RETURN_IF_ERROR(CheckCounts(*this));
  ISOMATCH_RETURN_IF_ERROR(CheckSizes(*this));
  ISOMATCH_RETURN_IF_ERROR(CheckTimes(*this));
  ISOMATCH_RETURN_IF_ERROR(CheckWord(
      "--log-level", log_level,
      {"trace", "debug", "info", "warn", "error", "critical", "off"}));
  return CheckWord("--log-format", log_format, {"text", "json"});
}

}  // namespace isomatch
