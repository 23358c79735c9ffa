#pragma once

#include <cstdint>
#include <string>

#include "server/postgres/blob_content.h"
#include "server/postgres/postgres_pool.h"

namespace isomatch {

/// Content in rows of isomatch.blob_chunks, which come and go with those of
/// isomatch.blobs.
class BlobRows : public BlobContent {
 public:
  /// REQUIRES: the pool outlives it.
  explicit BlobRows(PostgresPool* pool) : pool_(*pool) {}

  absl::StatusOr<BlobPlace> Write(const BlobKey& key,
                                  const std::string& bytes) override;
  void Insert(pqxx::work& transaction, const BlobKey& key,
              const std::string& bytes) override;
  void TakeBack(const BlobPlace& /*place*/) override {}
  absl::StatusOr<std::string> Read(const BlobKey& key,
                                   const BlobPlace& place) override;
  void RemoveDropped() override {}
  void Tidy() override {}
  absl::Status TryWriting(std::int64_t bytes) override;

 private:
  PostgresPool& pool_;
};

}  // namespace isomatch
