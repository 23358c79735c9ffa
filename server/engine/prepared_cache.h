#pragma once

#include <cstdint>
#include <list>
#include <map>
#include <optional>
#include <stop_token>
#include <string>

#include "core/base/mutex.h"
#include "core/pipeline/prepared_shape.h"
#include "server/storage/blob_store.h"

namespace isomatch {

/// Shapes that were prepared for earlier jobs: in memory, never more than
/// `capacity_bytes` of them, the least recently used go first; those that were
/// used again also in a blob store that outlives the process.
///
/// A key's sha256 is of all that the shape depends on: the digest of the mesh,
/// how its vertices are numbered, PreparationText of the options.
///
/// Thread-safe.
class PreparedCache {
 public:
  /// How often Find was asked, and where it found.
  struct Counts {
    std::int64_t in_memory = 0;
    std::int64_t on_disk = 0;
    std::int64_t missing = 0;
  };

  /// Keeps nothing and finds nothing with 0 bytes. `disk` may be null, and
  /// finds its blobs by names that are not the digests of their content.
  PreparedCache(std::int64_t capacity_bytes, BlobStore* disk)
      : capacity_bytes_(capacity_bytes), disk_(disk) {}

  /// Returns the shape, or nullopt. A second use puts it on disk.
  std::optional<PreparedShape> Find(const BlobKey& key,
                                    const std::stop_token& stop);

  std::int64_t capacity_bytes() const { return capacity_bytes_; }

  /// Keeps the shape, unless it is larger than all the room.
  void Keep(const BlobKey& key, const PreparedShape& shape);

  /// Bytes of the shapes in memory.
  std::int64_t size_bytes() const;
  Counts counts() const;

 private:
  struct Entry {
    BlobKey key;
    PreparedShape shape;
    std::int64_t bytes;
    bool is_on_disk;
  };

  std::optional<PreparedShape> FindInMemory(const BlobKey& key, bool& write);
  std::optional<PreparedShape> FindOnDisk(const BlobKey& key,
                                          const std::stop_token& stop);
  void Insert(const BlobKey& key, const PreparedShape& shape, bool is_on_disk);

  const std::int64_t capacity_bytes_;
  BlobStore* const disk_;
  mutable Mutex mutex_;
  /// Most recently used first.
  std::list<Entry> entries_ ABSL_GUARDED_BY(mutex_);
  std::map<BlobKey, std::list<Entry>::iterator> by_key_ ABSL_GUARDED_BY(mutex_);
  std::int64_t size_bytes_ ABSL_GUARDED_BY(mutex_) = 0;
  Counts counts_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace isomatch
