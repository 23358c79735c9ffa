#include "server/config/server_limits.h"

#include <algorithm>
#include <thread>

#include "server/machine/available_memory.h"
#include "server/rpc/channel_arguments.h"

namespace isomatch {
namespace {

constexpr int kUploads = 16;
constexpr int kRequests = 32;

bool HasTenants(const ServerConfig& config) { return !config.api_keys.empty(); }

/// What one tenant may have of `all`.
std::int64_t ShareOf(std::int64_t all, const ServerConfig& config) {
  return HasTenants(config) ? (all + 1) / 2 : all;
}

int Otherwise(int limit, std::int64_t otherwise) {
  return limit == 0 ? static_cast<int>(otherwise) : limit;
}

/// Room for one job at least, as ServerConfig asks for it.
std::int64_t StoredBytes(const ServerConfig& config) {
  if (config.max_bytes_per_tenant != 0 || !HasTenants(config)) {
    return config.max_bytes_per_tenant;
  }
  return std::max(ShareOf(config.blob_store_bytes, config),
                  2 * config.max_mesh_bytes + config.max_request_bytes);
}

}  // namespace

std::int64_t ChooseBudgetBytes(const ServerConfig& config) {
  return ChooseMemoryBudget(config.memory_budget_bytes, AvailableMemoryBytes());
}

std::int64_t ChoosePreparedCacheBytes(const ServerConfig& config) {
  return std::min(config.prepared_cache_bytes, ChooseBudgetBytes(config) / 4);
}

int ChooseThreads(const ServerConfig& config) {
  if (config.threads_per_job > 0) return config.threads_per_job;
  const int cores = static_cast<int>(std::thread::hardware_concurrency());
  return std::max(1, cores / config.workers);
}

std::int64_t ChooseMaxResidentBytes(const ServerConfig& config) {
  if (config.max_resident_bytes > 0) return config.max_resident_bytes;
  constexpr double kMost = 0.95;
  const std::int64_t budget = ChooseBudgetBytes(config);
  const std::int64_t wanted =
      budget + budget / 4 + static_cast<std::int64_t>(kGrpcBytes) +
      (config.is_durable() ? 0 : config.blob_store_bytes);
  return std::min(wanted,
                  static_cast<std::int64_t>(
                      kMost * static_cast<double>(AvailableMemoryBytes())));
}

std::int64_t RequestBytes(const ServerConfig& config) {
  return std::min(config.blob_store_bytes / 2, ChooseBudgetBytes(config) / 32);
}

std::int64_t UploadBytes(const ServerConfig& config) {
  return std::min(config.blob_store_bytes / 2, ChooseBudgetBytes(config) / 16);
}

std::int64_t DownloadBytes(const ServerConfig& config) {
  return ChooseBudgetBytes(config) / 64;
}

int IntakeThreads(const ServerConfig& config) {
  return HasTenants(config) ? 2 : 1;
}

std::int64_t ReadingBytes(const ServerConfig& config) {
  return ChooseBudgetBytes(config) / 8 / IntakeThreads(config);
}

TenantLimits TenantLimitsOf(const ServerConfig& config) {
  const bool has_tenants = HasTenants(config);
  const std::int64_t workers =
      has_tenants ? (3 * std::int64_t{config.workers} + 3) / 4 : config.workers;
  TenantLimits limits;
  limits.queued_jobs = Otherwise(config.max_queued_jobs_per_tenant,
                                 ShareOf(config.max_queued_jobs, config));
  limits.running_jobs = Otherwise(config.max_running_jobs_per_tenant, workers);
  limits.kept_jobs = Otherwise(config.max_kept_jobs_per_tenant,
                               ShareOf(config.max_kept_jobs, config));
  limits.stored_bytes = StoredBytes(config);
  limits.uploads = Otherwise(config.max_uploads_per_tenant,
                             has_tenants ? kUploads : TenantLimits::kNone);
  limits.upload_bytes = ShareOf(UploadBytes(config), config);
  limits.requests = Otherwise(config.max_requests_per_tenant,
                              has_tenants ? kRequests : TenantLimits::kNone);
  limits.request_bytes = ShareOf(RequestBytes(config), config);
  limits.download_bytes = ShareOf(DownloadBytes(config), config);
  return limits;
}

RequestLimits MakeRequestLimits(const ServerConfig& config) {
  RequestLimits limits;
  limits.tenant = TenantLimitsOf(config);
  limits.max_request_bytes =
      std::min(config.max_request_bytes, limits.tenant.request_bytes);
  // A chunk is a request, too.
  limits.max_chunk_bytes = std::clamp<std::int64_t>(
      limits.max_request_bytes / 2, 1, limits.max_chunk_bytes);
  limits.max_mesh_bytes =
      std::min(config.max_mesh_bytes, limits.tenant.upload_bytes);
  limits.max_queued_jobs = config.max_queued_jobs;
  limits.max_reading_bytes = ReadingBytes(config);
  return limits;
}

}  // namespace isomatch
