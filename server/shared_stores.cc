#include "server/shared_stores.h"

#include <memory>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/postgres/migrations.h"
#include "server/postgres/postgres_blob_store.h"
#include "server/postgres/postgres_job_store.h"
#include "server/postgres/postgres_pool.h"
#include "server/postgres/postgres_upload_store.h"
#include "server/storage/files.h"

namespace isomatch {
namespace {

/// Of downloads that several clients ask for.
constexpr std::int64_t kBlobCacheBytes = std::int64_t{64} << 20;

/// Threads that ask the database at the same time: those of intake (2), changes
/// (2), disk (2), upkeep (1), cluster (5) and reads (8), and the workers.
int Connections(const ServerConfig& config) {
  constexpr int kOthers = 20;
  return kOthers + (config.runs_jobs() ? config.workers : 0);
}

/// Returns the first line of the file.
absl::StatusOr<std::string> ReadPassword(const std::string& path) {
  constexpr std::int64_t kMostBytes = 4096;
  auto text = ReadWholeFile(path, kMostBytes);
  if (!text.ok()) {
    return absl::UnavailableError(absl::StrCat("--store-password-file = ", path,
                                               ": ", text.status().message()));
  }
  std::string password = text->substr(0, text->find('\n'));
  if (!password.empty()) return password;
  return absl::UnavailableError(
      absl::StrCat("--store-password-file = ", path,
                   " is empty, expected the password in its first line"));
}

absl::StatusOr<std::unique_ptr<PostgresPool>> OpenPool(
    const ServerConfig& config) {
  PostgresPool::Options options = {.url = config.store,
                                   .connections = Connections(config)};
  if (!config.store_password_file.empty()) {
    options.password = [path = config.store_password_file] {
      return ReadPassword(path);
    };
  }
  return PostgresPool::Open(std::move(options));
}

}  // namespace

absl::StatusOr<Stores> OpenAnyStores(const ServerConfig& config) {
  if (!config.is_shared()) return OpenStores(config);
  ISOMATCH_ASSIGN_OR_RETURN(std::shared_ptr<PostgresPool> pool,
                            OpenPool(config));
  ISOMATCH_RETURN_IF_ERROR(CheckSchema(*pool));
  Stores stores;
  auto jobs = std::make_unique<PostgresJobStore>(
      pool.get(),
      PostgresJobStore::Options{.unwatched_grace = config.unwatched_grace});
  stores.shared = jobs.get();
  stores.jobs = std::move(jobs);
  auto blobs = std::make_unique<PostgresBlobStore>(
      pool.get(), PostgresBlobStore::Options{
                      .capacity_bytes = config.blob_store_bytes,
                      .cache_bytes = kBlobCacheBytes,
                      .folder = config.blob_dir,
                      .puts_into_folder = !config.blob_dir_read_only});
  ISOMATCH_RETURN_IF_ERROR(blobs->Check());
  stores.blobs = std::move(blobs);
  stores.uploads = std::make_unique<PostgresUploadStore>(
      pool.get(),
      PostgresUploadStore::Options{.kept_for = config.partial_upload_kept});
  stores.database = std::move(pool);
  return stores;
}

absl::StatusOr<std::string> MigrateStore(const ServerConfig& config) {
  ISOMATCH_ASSIGN_OR_RETURN(const std::unique_ptr<PostgresPool> pool,
                            OpenPool(config));
  ISOMATCH_ASSIGN_OR_RETURN(const Migrated migrated, Migrate(*pool));
  const auto& [database, from, to] = migrated;
  if (from == to) {
    return absl::StrCat("nothing to do: the tables of ", database,
                        " have version ", to);
  }
  if (from == 0) {
    return absl::StrCat("made the tables of ", database, ", version ", to);
  }
  return absl::StrCat("brought the tables of ", database, " from version ",
                      from, " to ", to);
}

}  // namespace isomatch
