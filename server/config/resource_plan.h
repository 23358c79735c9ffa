#pragma once

#include <cstdint>

#include "server/config/server_config.h"
#include "server/convert/request_limits.h"
#include "server/jobs/tenant_limits.h"
#include "server/machine/machine.h"
#include "server/rpc/connection_table.h"

namespace isomatch {

/// How a server shares what its machine has. All in bytes unless said
/// otherwise.
struct ResourcePlan {
  /// Bytes for running jobs and for prepared meshes. Together they are the
  /// budget that the configuration sets, at most four fifths of the memory.
  std::int64_t job_bytes = 0;
  std::int64_t prepared_bytes = 0;

  // What is held beside the budget: unfinished uploads, requests, the meshes
  // that CreateJob decodes (those of a job that starts are within its
  // reservation), and results that are being sent. Fifteen sixty-fourths of the
  // budget together; it leaves sixteen at least, the last for the process
  // itself. What one thread of the intake decodes is
  // requests.max_reading_bytes.

  std::int64_t request_bytes = 0;
  std::int64_t upload_bytes = 0;
  /// A job takes more than a hundred times a part of its result while it runs.
  std::int64_t download_bytes = 0;

  /// What may be resident: the budget, a quarter of it for what is held beside
  /// it, gRPC's buffers, and blobs in memory.
  std::int64_t max_resident_bytes = 0;

  /// What the result of one job may take of the blobs.
  std::int64_t max_result_bytes = 0;

  /// Each job gets.
  int threads_per_job = 1;
  /// Threads that decode CreateJob's meshes: with API keys two, of which a
  /// tenant may use one.
  int intake_threads = 1;

  /// Without API keys, what the configuration says. With them also what it does
  /// not say: half of all, so that no tenant keeps others out; of the workers
  /// three quarters.
  TenantLimits tenant;
  /// What a request may contain: what never has room is refused as too large,
  /// and nobody waits for it.
  RequestLimits requests;
  /// As the configuration says, by default 10,000, but so many that a quarter
  /// of the files, at most 1024, is left for stores and for gRPC itself; of one
  /// address by default an eighth of that, without a limit behind an edge, from
  /// which all connections come.
  ConnectionLimits connections{};
};

ResourcePlan PlanResources(const ServerConfig& config, const Machine& machine);

}  // namespace isomatch
