#pragma once

#include <cstdint>

#include "server/config/server_config.h"
#include "server/convert/request_limits.h"
#include "server/jobs/tenant_limits.h"

namespace isomatch {

// How a configuration shares what the server has. All in bytes unless said
// otherwise.

/// Of running jobs and prepared meshes together.
std::int64_t ChooseBudgetBytes(const ServerConfig& config);
std::int64_t ChoosePreparedCacheBytes(const ServerConfig& config);

/// Each job gets.
int ChooseThreads(const ServerConfig& config);

/// What may be resident: the budget, a quarter of it for what is held beside
/// it, gRPC's buffers, and blobs in memory.
std::int64_t ChooseMaxResidentBytes(const ServerConfig& config);

// What is held beside the budget: unfinished uploads, requests, the meshes that
// CreateJob decodes (a job that starts decodes them within its reservation),
// and results that are being sent. Fifteen sixty-fourths of the budget
// together; ChooseMemoryBudget leaves sixteen at least, the last for the
// process itself.

std::int64_t RequestBytes(const ServerConfig& config);
std::int64_t UploadBytes(const ServerConfig& config);
/// A job takes more than a hundred times a part of its result while it runs.
std::int64_t DownloadBytes(const ServerConfig& config);
/// Of one of the intake's threads.
std::int64_t ReadingBytes(const ServerConfig& config);

/// Threads that decode CreateJob's meshes: with API keys two, of which a tenant
/// may use one.
int IntakeThreads(const ServerConfig& config);

/// Without API keys, what the configuration says. With them also what it does
/// not say: half of all, so that no tenant keeps others out; of the workers
/// three quarters.
TenantLimits TenantLimitsOf(const ServerConfig& config);

/// What a request may contain: what never has room is refused as too large, and
/// nobody waits for it.
RequestLimits MakeRequestLimits(const ServerConfig& config);

}  // namespace isomatch
