#include "server/storage/memory_blob_store.h"

#include <list>
#include <memory>
#include <utility>

#include "absl/status/statusor.h"
#include "core/base/status_macros.h"

namespace isomatch {

absl::Status MemoryBlobStore::Put(const BlobKey& key, std::string bytes,
                                  Keep keep) {
  const auto size = static_cast<std::int64_t>(bytes.size());
  const auto blob = std::make_shared<const std::string>(std::move(bytes));
  std::list<BlobIndex::Entry> evicted;  // freed after the lock
  MutexLock lock(mutex_);
  BlobIndex::Entry* entry = index_.Touch(key);
  if (entry == nullptr) {
    ISOMATCH_ASSIGN_OR_RETURN(evicted, index_.MakeRoom(size));
    entry = &index_.Add({.key = key, .bytes = size, .blob = blob});
  }
  if (keep == Keep::kPinned) ++entry->pins;
  return absl::OkStatus();
}

bool MemoryBlobStore::Pin(const BlobKey& key) {
  MutexLock lock(mutex_);
  return index_.ChangePins(key, 1);
}

void MemoryBlobStore::Unpin(const BlobKey& key) {
  MutexLock lock(mutex_);
  (void)index_.ChangePins(key, -1);
}

absl::StatusOr<BlobStore::Blob> MemoryBlobStore::Get(const BlobKey& key) {
  MutexLock lock(mutex_);
  const BlobIndex::Entry* entry = index_.Touch(key);
  if (entry == nullptr) return absl::NotFoundError(key.sha256);
  return entry->blob;
}

void MemoryBlobStore::Remove(const BlobKey& key) {
  MutexLock lock(mutex_);
  const BlobIndex::Entry* entry = index_.Touch(key);
  if (entry != nullptr && entry->pins == 0) index_.Remove(key);
}

bool MemoryBlobStore::Has(const BlobKey& key) {
  MutexLock lock(mutex_);
  return index_.Touch(key) != nullptr;
}

bool MemoryBlobStore::MakeTenantRoom(const BlobKey& key, std::int64_t bytes,
                                     std::int64_t limit) {
  // Declared first: freed after the lock.
  absl::StatusOr<std::list<BlobIndex::Entry>> evicted =
      std::list<BlobIndex::Entry>();
  MutexLock lock(mutex_);
  evicted = index_.MakeTenantRoom(key, bytes, limit);
  return evicted.ok();
}

bool MemoryBlobStore::CanMakeRoom(std::int64_t bytes) const {
  MutexLock lock(mutex_);
  return bytes <= index_.RoomBytes();
}

std::int64_t MemoryBlobStore::size_bytes() const {
  MutexLock lock(mutex_);
  return index_.size_bytes();
}

}  // namespace isomatch
