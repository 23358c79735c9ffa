#pragma once

#include <chrono>
#include <cstdint>
#include <list>
#include <map>
#include <optional>

#include "core/base/mutex.h"
#include "server/storage/blob_store.h"

namespace isomatch {

/// Blobs in memory that are kept elsewhere, at most `capacity_bytes` of them;
/// the least recently used go first. Thread-safe.
class BlobCache {
 public:
  using TimePoint = std::chrono::steady_clock::time_point;

  struct Entry {
    BlobKey key;
    BlobStore::Blob blob;
    /// When they were last known to be there, where they are kept.
    TimePoint known_at;
  };

  explicit BlobCache(std::int64_t capacity_bytes)
      : capacity_bytes_(capacity_bytes) {}

  /// Returns the blob, which counts as a use.
  std::optional<Entry> Find(const BlobKey& key);

  /// Adds a blob, or the time at which it was known to be there. Nothing when
  /// it is larger than all that is kept.
  void Put(Entry entry);

  void Remove(const BlobKey& key);

 private:
  /// Moves the entry, if there is one, to `removed`.
  void Detach(const BlobKey& key, std::list<Entry>& removed)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  const std::int64_t capacity_bytes_;
  Mutex mutex_;
  /// Most recently used first.
  std::list<Entry> entries_ ABSL_GUARDED_BY(mutex_);
  std::map<BlobKey, std::list<Entry>::iterator> by_key_ ABSL_GUARDED_BY(mutex_);
  std::int64_t size_bytes_ ABSL_GUARDED_BY(mutex_) = 0;
};

}  // namespace isomatch
