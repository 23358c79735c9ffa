#pragma once

#include <cstddef>
#include <string>

#include "absl/time/time.h"
#include "server/postgres/postgres_pool.h"
#include "server/storage/upload_store.h"

namespace isomatch {

/// The tables of server/postgres/schema/003_uploads.sql. Thread-safe.
class PostgresUploadStore : public UploadStore {
 public:
  struct Options {
    /// Uploads, so that tiny ones cannot pile up.
    int max_kept = 1000;
    absl::Duration kept_for = absl::Minutes(5);
  };

  /// REQUIRES: the pool outlives the store.
  PostgresUploadStore(PostgresPool* pool, const Options& options)
      : pool_(*pool), options_(options) {}

  absl::Status Keep(const BlobKey& key, absl::string_view bytes,
                    const Limits& limits) override;
  absl::StatusOr<std::string> Read(const BlobKey& key) override;
  void Forget(const BlobKey& key) override;
  absl::StatusOr<std::vector<std::size_t>> ReceivedBytes(
      const std::string& tenant,
      const std::vector<std::string>& sha256s) override;
  void Tidy() override;

 private:
  PostgresPool& pool_;
  const Options options_;
};

}  // namespace isomatch
