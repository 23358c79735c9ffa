#pragma once

#include <cstdint>
#include <string>

#include "absl/status/status.h"
#include "core/base/mutex.h"
#include "server/storage/blob_index.h"
#include "server/storage/blob_store.h"

namespace isomatch {

/// Blobs in memory, never more than `capacity_bytes` of content. What is pinned
/// or still held by a caller of Get is not evicted. Thread-safe.
class MemoryBlobStore : public BlobStore {
 public:
  explicit MemoryBlobStore(std::int64_t capacity_bytes)
      : index_(capacity_bytes) {}

  absl::Status Put(const BlobKey& key, std::string bytes, Keep keep) override;
  bool Pin(const BlobKey& key) override;
  void Unpin(const BlobKey& key) override;
  absl::StatusOr<Blob> Get(const BlobKey& key) override;
  void Remove(const BlobKey& key) override;
  bool Has(const BlobKey& key) override;
  bool MakeTenantRoom(const BlobKey& key, std::int64_t bytes,
                      std::int64_t limit) override;
  bool CanMakeRoom(std::int64_t bytes) const override;
  std::int64_t size_bytes() const override;

 private:
  mutable Mutex mutex_;
  BlobIndex index_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace isomatch
