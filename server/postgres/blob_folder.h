#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "core/base/mutex.h"
#include "server/postgres/blob_content.h"
#include "server/postgres/postgres_pool.h"
#include "server/storage/shared_folder.h"

namespace isomatch {

/// Content in files of a folder that all processes share. A blob's file is
/// written before its row is, which has its name.
///
///   isomatch.dropped_files  names of files whose rows are gone, in the same
///                           transaction; whoever reads them removes the files
///   files without a row     a process ended between the two, or does not know
///                           whether its row came: they go after a day
///
/// The folder has a file `isomatch-blobs` that names the database: a folder
/// without it is not the one, as when it is not mounted, and then nothing is
/// lost or written (UNAVAILABLE). Thread-safe.
class BlobFolder : public BlobContent {
 public:
  /// REQUIRES: the pool outlives it.
  BlobFolder(PostgresPool* pool, std::string folder)
      : pool_(*pool), folder_(std::move(folder)) {}

  /// Whether the folder is there; marks it, when the database has none yet.
  /// UNAVAILABLE.
  absl::Status Check();

  absl::StatusOr<BlobPlace> Write(const BlobKey& key,
                                  const std::string& bytes) override;
  void Insert(pqxx::work& /*transaction*/, const BlobKey& /*key*/,
              const std::string& /*bytes*/) override {}
  void TakeBack(const BlobPlace& place) override;
  absl::StatusOr<std::string> Read(const BlobKey& key,
                                   const BlobPlace& place) override;
  void RemoveDropped() override;
  void Tidy() override;
  absl::Status TryWriting(std::int64_t bytes) override;

 private:
  /// Removes those of `files` that no row names.
  void RemoveUnknown(const std::vector<std::string>& files);

  PostgresPool& pool_;
  const SharedFolder folder_;
  Mutex mutex_;
  /// What the file has to say; empty while it is not known.
  std::string mark_ ABSL_GUARDED_BY(mutex_);
  std::chrono::steady_clock::time_point next_search_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace isomatch
