#pragma once

#include <cstdint>
#include <list>
#include <string>
#include <unordered_map>
#include <vector>

#include "absl/status/status.h"
#include "core/base/mutex.h"
#include "server/storage/blob_store.h"

namespace isomatch {

/// Blobs in memory, never more than `capacity_bytes` of content. What is pinned
/// or still held by a caller of Get is not evicted. Thread-safe.
class MemoryBlobStore : public BlobStore {
 public:
  explicit MemoryBlobStore(std::int64_t capacity_bytes)
      : capacity_bytes_(capacity_bytes) {}

  absl::Status Put(const std::string& sha256, std::string bytes,
                   Keep keep) override;
  void Unpin(const std::string& sha256) override;
  Blob Get(const std::string& sha256) override;
  std::int64_t size_bytes() const override;

 private:
  struct Entry {
    std::string sha256;
    Blob blob;
    int pins = 0;
  };
  using Entries = std::list<Entry>;

  /// Returns the entry, moved to the front, or end().
  Entries::iterator Touch(const std::string& sha256)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  /// Takes out unreferenced entries, the least recently used first, until
  /// `bytes` more fit or none is left. The caller frees them without the lock.
  Entries Evict(std::int64_t bytes) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  const std::int64_t capacity_bytes_;
  mutable Mutex mutex_;
  /// Most recently used first.
  Entries entries_ ABSL_GUARDED_BY(mutex_);
  std::unordered_map<std::string, Entries::iterator> by_sha256_
      ABSL_GUARDED_BY(mutex_);
  std::int64_t size_bytes_ ABSL_GUARDED_BY(mutex_) = 0;
};

}  // namespace isomatch
