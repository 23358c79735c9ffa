#include "server/engine/prepared_cache.h"

#include <iterator>
#include <utility>

namespace isomatch {

std::optional<PreparedShape> PreparedCache::Find(const BlobKey& key,
                                                 const std::stop_token& stop) {
  if (capacity_bytes_ == 0) return std::nullopt;
  bool write = false;
  std::optional<PreparedShape> shape = FindInMemory(key, write);
  if (!shape) return FindOnDisk(key, stop);
  if (write && !stop.stop_requested()) {  // a cache: when the disk refuses, it
                                          // does without
    (void)disk_->Put(key, SerializePreparedShape(*shape), Keep::kWhileRoom);
  }
  return shape;
}

std::optional<PreparedShape> PreparedCache::FindInMemory(const BlobKey& key,
                                                         bool& write) {
  MutexLock lock(mutex_);
  const auto found = by_key_.find(key);
  if (found == by_key_.end()) return std::nullopt;
  ++counts_.in_memory;
  entries_.splice(entries_.begin(), entries_, found->second);
  Entry& entry = entries_.front();
  write = disk_ != nullptr && !std::exchange(entry.is_on_disk, true);
  return entry.shape;
}

std::optional<PreparedShape> PreparedCache::FindOnDisk(
    const BlobKey& key, const std::stop_token& stop) {
  const auto bytes = disk_ == nullptr ? absl::StatusOr<BlobStore::Blob>(nullptr)
                                      : disk_->Get(key);
  if (bytes.ok() && *bytes != nullptr) {
    auto parsed = ParsePreparedShape(**bytes, stop);
    if (parsed.ok()) {
      Insert(key, *parsed, /*is_on_disk=*/true);
      MutexLock lock(mutex_);
      ++counts_.on_disk;
      return *std::move(parsed);
    }
    // Damaged, or of another version.
    if (!absl::IsCancelled(parsed.status())) disk_->Remove(key);
  }
  MutexLock lock(mutex_);
  ++counts_.missing;
  return std::nullopt;
}

void PreparedCache::Keep(const BlobKey& key, const PreparedShape& shape) {
  Insert(key, shape, /*is_on_disk=*/false);
}

void PreparedCache::Insert(const BlobKey& key, const PreparedShape& shape,
                           bool is_on_disk) {
  const std::int64_t bytes = PreparedShapeBytes(shape);
  if (bytes > capacity_bytes_) return;
  std::list<Entry> evicted;  // freed after the lock
  MutexLock lock(mutex_);
  if (by_key_.count(key) != 0) return;
  while (size_bytes_ > capacity_bytes_ - bytes) {
    size_bytes_ -= entries_.back().bytes;
    by_key_.erase(entries_.back().key);
    evicted.splice(evicted.begin(), entries_, std::prev(entries_.end()));
  }
  entries_.push_front({key, shape, bytes, is_on_disk});
  by_key_[key] = entries_.begin();
  size_bytes_ += bytes;
}

std::int64_t PreparedCache::size_bytes() const {
  MutexLock lock(mutex_);
  return size_bytes_;
}

PreparedCache::Counts PreparedCache::counts() const {
  MutexLock lock(mutex_);
  return counts_;
}

}  // namespace isomatch
