#include "server/postgres/blob_cache.h"

#include <utility>

namespace isomatch {
namespace {

std::int64_t SizeOf(const BlobCache::Entry& entry) {
  return static_cast<std::int64_t>(entry.blob->size());
}

}  // namespace

std::optional<BlobCache::Entry> BlobCache::Find(const BlobKey& key) {
  MutexLock lock(mutex_);
  const auto found = by_key_.find(key);
  if (found == by_key_.end()) return std::nullopt;
  entries_.splice(entries_.begin(), entries_, found->second);
  return *found->second;
}

void BlobCache::Put(Entry entry) {
  std::list<Entry> added;  // nothing has changed if memory ends here
  added.push_front(std::move(entry));
  std::list<Entry> removed;  // freed after the lock
  MutexLock lock(mutex_);
  Detach(added.front().key, removed);
  const std::int64_t bytes = SizeOf(added.front());
  if (bytes > capacity_bytes_) return;
  while (size_bytes_ + bytes > capacity_bytes_) {
    Detach(entries_.back().key, removed);
  }
  by_key_.emplace(added.front().key, added.begin());
  entries_.splice(entries_.begin(), added);
  size_bytes_ += bytes;
}

void BlobCache::Remove(const BlobKey& key) {
  std::list<Entry> removed;  // freed after the lock
  MutexLock lock(mutex_);
  Detach(key, removed);
}

void BlobCache::Detach(const BlobKey& key, std::list<Entry>& removed) {
  const auto found = by_key_.find(key);
  if (found == by_key_.end()) return;
  size_bytes_ -= SizeOf(*found->second);
  removed.splice(removed.end(), entries_, found->second);
  by_key_.erase(found);
}

}  // namespace isomatch
