#pragma once

#include "absl/time/time.h"
#include "server/convert/parse_create_job.h"
#include "server/jobs/job_manager.h"
#include "server/jobs/memory_budget.h"
#include "server/jobs/partial_uploads.h"
#include "server/jobs/tenant_budgets.h"
#include "server/jobs/tenant_turns.h"
#include "server/metrics/metrics.h"
#include "server/rpc/security/access.h"
#include "server/storage/blob_store.h"

namespace isomatch {

/// What a watcher waits before it asks again for a job that goes on later.
inline constexpr absl::Duration kRetryDraining = absl::Seconds(10);

/// What the RPCs work with. All of it outlives the gRPC server.
struct ServiceContext {
  /// Asked before anything else, by every RPC.
  const Access* access;
  JobManager* manager;
  BlobStore* blobs;
  MemoryBudget* budget;
  /// Room for CreateJob requests that wait for `intake`, unparsed.
  TenantBudgets* requests;
  /// Not of bytes: one for each UploadMesh call that runs.
  TenantBudgets* uploads;
  /// Room for parts of results that are being sent.
  TenantBudgets* downloads;
  /// Room for unfinished uploads, and what those that broke off have brought.
  PartialUploads* partial_uploads;
  /// Decodes and checks CreateJob's meshes, a few requests at a time, so that
  /// gRPC threads stay free and decoding needs bounded memory.
  TenantTurns* intake;
  /// Writes jobs that are cancelled or deleted to disk, which gRPC's threads do
  /// not wait for.
  TenantTurns* changes;
  /// Reads jobs where they are in a database; null where they are in memory.
  TenantTurns* reads = nullptr;
  /// The same of meshes and results, which are larger: writes and reads them.
  TenantTurns* disk;
  Metrics* metrics = &NullMetrics();
  ParseContext parse;
  bool durable = false;
  absl::Duration job_retention = absl::InfiniteDuration();
  /// Zero for no limit.
  absl::Duration max_run_time = absl::ZeroDuration();
  absl::Duration watch_heartbeat = absl::Seconds(10);
  absl::Duration upload_idle_timeout = absl::Seconds(30);
};

}  // namespace isomatch
