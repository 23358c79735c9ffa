#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "server/config/server_config.h"
#include "server/jobs/retention_clock.h"
#include "server/storage/blob_store.h"
#include "server/storage/files.h"
#include "server/storage/job_journal.h"
#include "server/storage/job_store.h"
#include "server/storage/process_trace.h"
#include "server/storage/shared_job_store.h"
#include "server/storage/upload_store.h"

namespace isomatch {

/// Where the server keeps jobs, meshes and results.
struct Stores {
  /// Lock on the data directory; not set without one.
  std::optional<FolderLock> lock;
  /// What the stores below work with; null without a database.
  std::shared_ptr<void> database;
  std::unique_ptr<JobJournal> journal;
  std::unique_ptr<JobStore> jobs;
  /// `jobs` if other processes use it, too; else null.
  SharedJobStore* shared = nullptr;
  std::unique_ptr<BlobStore> blobs;
  /// Of uploads that broke off; null when they are kept in memory.
  std::unique_ptr<UploadStore> uploads;
  /// Null without a data directory, or when the configuration wants none.
  std::unique_ptr<BlobStore> prepared;
  /// Null without a data directory.
  std::unique_ptr<TraceStore> traces;
  /// The latest time that is known to have been: the last that a server
  /// believed, or one of a job.
  std::optional<absl::Time> last_seen;
};

/// Opens the stores in config.data_dir, which is made if need be: jobs.sqlite,
/// running.json and the folders blobs and prepared; on a full disk what is in
/// prepared is given up for the others. In memory when the
/// configuration is not durable. REQUIRES: !config.is_shared(). Errors name the
/// directory: FAILED_PRECONDITION when another server uses it, or a newer
/// version wrote it; UNAVAILABLE when it cannot be used; DATA_LOSS when it is
/// damaged.
absl::StatusOr<Stores> OpenStores(const ServerConfig& config);

/// Opens the stores of a configuration.
using StoreOpener =
    std::function<absl::StatusOr<Stores>(const ServerConfig& config)>;

/// The clocks of this machine; what was believed is saved for
/// Stores::last_seen, if there is a data directory. The log is told.
RetentionClock::Environment MakeClockEnvironment(const ServerConfig& config);

}  // namespace isomatch
