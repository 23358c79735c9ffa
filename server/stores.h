#pragma once

#include <memory>
#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "server/server_config.h"
#include "server/storage/blob_store.h"
#include "server/storage/files.h"
#include "server/storage/job_journal.h"
#include "server/storage/job_store.h"
#include "server/storage/process_trace.h"

namespace isomatch {

/// Where the server keeps jobs, meshes and results.
struct Stores {
  /// Of the data directory; not set without one.
  std::optional<FolderLock> lock;
  std::unique_ptr<JobJournal> journal;
  std::unique_ptr<JobStore> jobs;
  std::unique_ptr<BlobStore> blobs;
  /// Null without a data directory, or when the configuration wants none.
  std::unique_ptr<BlobStore> prepared;
  /// Null without a data directory.
  std::unique_ptr<TraceStore> traces;
};

/// Opens the stores in config.data_dir, which is made if need be: jobs.sqlite,
/// running.json and the folders blobs and prepared. In memory when the
/// configuration is not durable. Errors name the directory: FAILED_PRECONDITION
/// when another server uses it, or a newer version wrote it; UNAVAILABLE when
/// it cannot be used; DATA_LOSS when it is damaged.
absl::StatusOr<Stores> OpenStores(const ServerConfig& config);

// The time that a server last believed, in a small file; see RetentionClock.
std::optional<absl::Time> LoadLastSeen(const std::string& path);
void SaveLastSeen(const std::string& path, absl::Time time);

}  // namespace isomatch
