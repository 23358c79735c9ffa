#include "server/jobs/partial_uploads.h"

#include <algorithm>

#include "server/jobs/errors.h"

namespace isomatch {

absl::StatusOr<MemoryBudget::Reservation> PartialUploads::Reserve(
    std::int64_t bytes) {
  while (true) {
    auto reserved = budget_->Reserve(bytes);
    if (reserved.ok()) return reserved;
    if (!DropOldestFor(bytes)) return UploadQuota(bytes, kRetryUploadQuota);
  }
}

void PartialUploads::Keep(const BlobKey& key, PartialUpload upload) {
  if (upload.bytes.empty()) return;
  upload.bytes.shrink_to_fit();
  upload.reservation.ShrinkTo(static_cast<std::int64_t>(upload.bytes.size()));
  std::uint64_t age_order = 0;
  {
    MutexLock lock(mutex_);
    age_order = ++last_age_order_;
  }
  Entry added{std::move(upload), age_order,
              timers_->PostAfter(keep_for_, [this, key, age_order] {
                Expire(key, age_order);
              })};
  Entries::node_type dropped;  // as `added`, freed after the lock
  MutexLock lock(mutex_);
  Entry& entry = entries_[key];
  if (entry.upload.bytes.size() > added.upload.bytes.size()) return;
  std::swap(entry, added);
  if (entries_.size() > kMaxKept) dropped = ExtractOldest();
}

PartialUpload PartialUploads::Take(const BlobKey& key) {
  Entries::node_type taken;  // its timer is freed after the lock
  {
    MutexLock lock(mutex_);
    taken = entries_.extract(key);
  }
  return taken ? std::move(taken.mapped().upload) : PartialUpload();
}

std::size_t PartialUploads::ReceivedBytes(const BlobKey& key) const {
  MutexLock lock(mutex_);
  const auto found = entries_.find(key);
  return found == entries_.end() ? 0 : found->second.upload.bytes.size();
}

void PartialUploads::Clear() {
  Entries dropped;
  MutexLock lock(mutex_);
  dropped.swap(entries_);
}

void PartialUploads::Expire(const BlobKey& key, std::uint64_t age_order) {
  Entries::node_type expired;
  MutexLock lock(mutex_);
  const auto found = entries_.find(key);
  if (found == entries_.end() || found->second.age_order != age_order) return;
  expired = entries_.extract(found);
}

bool PartialUploads::DropOldestFor(std::int64_t bytes) {
  Entries::node_type dropped;
  MutexLock lock(mutex_);
  const std::int64_t of_others = budget_->reserved_bytes() - KeptBytes();
  if (entries_.empty() || bytes > budget_->total_bytes() - of_others) {
    return false;
  }
  dropped = ExtractOldest();
  return true;
}

PartialUploads::Entries::node_type PartialUploads::ExtractOldest() {
  return entries_.extract(std::min_element(
      entries_.begin(), entries_.end(), [](const auto& a, const auto& b) {
        return a.second.age_order < b.second.age_order;
      }));
}

std::int64_t PartialUploads::KeptBytes() const {
  std::int64_t bytes = 0;
  for (const auto& [key, entry] : entries_) {
    bytes += entry.upload.reservation.bytes();
  }
  return bytes;
}

}  // namespace isomatch
