#include "server/config/resource_plan.h"

#include <algorithm>

#include "server/rpc/channel_arguments.h"

namespace isomatch {
namespace {

constexpr int kUploads = 16;
constexpr int kRequests = 32;
/// An idle connection takes about 20 kB, so this many take 200 MB.
constexpr std::int64_t kMostConnections = 10'000;
constexpr std::int64_t kMostReservedFiles = 1024;

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

std::int64_t PartOf(std::int64_t bytes, double part) {
  return static_cast<std::int64_t>(part * static_cast<double>(bytes));
}

/// Returns the bytes that running jobs and prepared meshes share.
std::int64_t BudgetBytes(const ServerConfig& config, const Machine& machine) {
  constexpr double kMost = 0.8;  // the rest is for gRPC, blobs and the system
  const std::int64_t most = PartOf(machine.memory_bytes, kMost);
  return config.memory_budget_bytes == 0
             ? most
             : std::min(config.memory_budget_bytes, most);
}

std::int64_t MaxResidentBytes(const ServerConfig& config,
                              const Machine& machine) {
  if (config.max_resident_bytes > 0) return config.max_resident_bytes;
  constexpr double kMost = 0.95;
  const std::int64_t budget = BudgetBytes(config, machine);
  const std::int64_t wanted =
      budget + budget / 4 + static_cast<std::int64_t>(kGrpcBytes) +
      (config.is_durable() ? 0 : config.blob_store_bytes);
  return std::min(wanted, PartOf(machine.memory_bytes, kMost));
}

/// How many jobs of a tenant may run. Processes that share a store count those
/// of all together, which may be more than one of them can run: there the turns
/// alone keep a tenant from having all.
std::int64_t RunningJobs(const ServerConfig& config) {
  if (config.is_shared()) return TenantLimits::kNone;
  const std::int64_t workers = config.workers;
  return HasTenants(config) ? (3 * workers + 3) / 4 : workers;
}

/// By what `plan` has of bytes.
TenantLimits LimitsOfTenants(const ServerConfig& config,
                             const ResourcePlan& plan) {
  const bool has_tenants = HasTenants(config);
  TenantLimits limits;
  limits.queued_jobs = Otherwise(config.max_queued_jobs_per_tenant,
                                 ShareOf(config.max_queued_jobs, config));
  limits.running_jobs =
      Otherwise(config.max_running_jobs_per_tenant, RunningJobs(config));
  limits.kept_jobs = Otherwise(config.max_kept_jobs_per_tenant,
                               ShareOf(config.max_kept_jobs, config));
  limits.stored_bytes = StoredBytes(config);
  limits.uploads = Otherwise(config.max_uploads_per_tenant,
                             has_tenants ? kUploads : TenantLimits::kNone);
  limits.upload_bytes = ShareOf(plan.upload_bytes, config);
  limits.requests = Otherwise(config.max_requests_per_tenant,
                              has_tenants ? kRequests : TenantLimits::kNone);
  limits.request_bytes = ShareOf(plan.request_bytes, config);
  limits.download_bytes = ShareOf(plan.download_bytes, config);
  return limits;
}

RequestLimits LimitsOfRequests(const ServerConfig& config,
                               const TenantLimits& tenant) {
  RequestLimits limits;
  limits.tenant = tenant;
  limits.max_request_bytes =
      std::min(config.max_request_bytes, tenant.request_bytes);
  // A chunk is a request, too.
  limits.max_chunk_bytes = std::clamp<std::int64_t>(
      limits.max_request_bytes / 2, 1, limits.max_chunk_bytes);
  limits.max_mesh_bytes = std::min(config.max_mesh_bytes, tenant.upload_bytes);
  limits.max_queued_jobs = config.max_queued_jobs;
  return limits;
}

ConnectionLimits LimitsOfConnections(const ServerConfig& config,
                                     std::int64_t files) {
  const std::int64_t room = files - std::min(kMostReservedFiles, files / 4);
  const std::int64_t wanted =
      config.max_connections > 0 ? config.max_connections : kMostConnections;
  ConnectionLimits limits{};
  limits.most =
      static_cast<int>(std::max(std::int64_t{1}, std::min(wanted, room)));
  if (config.behind_edge) return limits;
  limits.of_one_address = config.max_connections_per_address > 0
                              ? config.max_connections_per_address
                              : std::max(1, limits.most / 8);
  return limits;
}

}  // namespace

ResourcePlan PlanResources(const ServerConfig& config, const Machine& machine) {
  const std::int64_t budget = BudgetBytes(config, machine);
  ResourcePlan plan;
  plan.prepared_bytes = std::min(config.prepared_cache_bytes, budget / 4);
  plan.job_bytes = budget - plan.prepared_bytes;
  plan.request_bytes = std::min(config.blob_store_bytes / 2, budget / 32);
  plan.upload_bytes = std::min(config.blob_store_bytes / 2, budget / 16);
  plan.download_bytes = budget / 64;
  plan.max_resident_bytes = MaxResidentBytes(config, machine);
  plan.max_result_bytes = config.blob_store_bytes / 4;
  plan.threads_per_job = config.threads_per_job > 0
                             ? config.threads_per_job
                             : std::max(1, machine.cores / config.workers);
  plan.intake_threads = HasTenants(config) ? 2 : 1;
  plan.tenant = LimitsOfTenants(config, plan);
  plan.requests = LimitsOfRequests(config, plan.tenant);
  plan.requests.max_reading_bytes = budget / 8 / plan.intake_threads;
  plan.connections = LimitsOfConnections(config, machine.files);
  return plan;
}

}  // namespace isomatch
