#include "server/storage/memory_blob_store.h"

#include <iterator>
#include <memory>
#include <utility>

#include "absl/strings/str_cat.h"

namespace isomatch {
namespace {

std::int64_t Size(const BlobStore::Blob& blob) {
  return static_cast<std::int64_t>(blob->size());
}

}  // namespace

absl::Status MemoryBlobStore::Put(const std::string& sha256, std::string bytes,
                                  Keep keep) {
  const auto blob = std::make_shared<const std::string>(std::move(bytes));
  Entries evicted;  // freed after the lock
  MutexLock lock(mutex_);
  auto entry = Touch(sha256);
  if (entry == entries_.end()) {
    evicted = Evict(Size(blob));
    if (size_bytes_ > capacity_bytes_ - Size(blob)) {
      return absl::ResourceExhaustedError(
          absl::StrCat("no room for ", Size(blob), " bytes beside ",
                       size_bytes_, " of ", capacity_bytes_));
    }
    entry = entries_.insert(entries_.begin(), Entry{sha256, blob});
    by_sha256_[sha256] = entry;
    size_bytes_ += Size(blob);
  }
  if (keep == Keep::kPinned) ++entry->pins;
  return absl::OkStatus();
}

void MemoryBlobStore::Unpin(const std::string& sha256) {
  MutexLock lock(mutex_);
  const auto found = by_sha256_.find(sha256);
  if (found != by_sha256_.end() && found->second->pins > 0) {
    --found->second->pins;
  }
}

BlobStore::Blob MemoryBlobStore::Get(const std::string& sha256) {
  MutexLock lock(mutex_);
  const auto entry = Touch(sha256);
  return entry == entries_.end() ? nullptr : entry->blob;
}

std::int64_t MemoryBlobStore::size_bytes() const {
  MutexLock lock(mutex_);
  return size_bytes_;
}

MemoryBlobStore::Entries::iterator MemoryBlobStore::Touch(
    const std::string& sha256) {
  const auto found = by_sha256_.find(sha256);
  if (found == by_sha256_.end()) return entries_.end();
  entries_.splice(entries_.begin(), entries_, found->second);
  return found->second;
}

MemoryBlobStore::Entries MemoryBlobStore::Evict(std::int64_t bytes) {
  Entries evicted;
  auto entry = entries_.end();
  while (entry != entries_.begin() && size_bytes_ > capacity_bytes_ - bytes) {
    --entry;
    const bool referenced = entry->pins > 0 || entry->blob.use_count() > 1;
    if (referenced) continue;
    const auto victim = entry++;
    size_bytes_ -= Size(victim->blob);
    by_sha256_.erase(victim->sha256);
    evicted.splice(evicted.begin(), entries_, victim);
  }
  return evicted;
}

}  // namespace isomatch
