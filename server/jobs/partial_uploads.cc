#include "server/jobs/partial_uploads.h"

#include <algorithm>

#include "core/base/status_macros.h"
#include "server/jobs/errors.h"

namespace isomatch {

absl::StatusOr<MemoryBudget::Reservation> MemoryPartialUploads::Reserve(
    const std::string& tenant, std::int64_t bytes) {
  MemoryBudget& own = budgets_->Of(tenant);
  while (true) {
    auto reserved = own.Reserve(bytes);
    if (reserved.ok()) return reserved;
    ISOMATCH_RETURN_IF_ERROR(DropOneFor(tenant, bytes));
  }
}

absl::Status MemoryPartialUploads::CheckRoom(const std::string& tenant,
                                             std::int64_t bytes) const {
  MutexLock lock(mutex_);
  return CheckRoomLocked(tenant, bytes);
}

absl::Status MemoryPartialUploads::CheckRoomLocked(const std::string& tenant,
                                                   std::int64_t bytes) const {
  std::int64_t kept_own = 0;
  std::int64_t kept = 0;
  for (const auto& [of, entries] : KeptByTenant()) {
    kept += entries.bytes;
    if (of == tenant) kept_own = entries.bytes;
  }
  const MemoryBudget& own = budgets_->Of(tenant);
  if (bytes > own.total_bytes() - (own.reserved_bytes() - kept_own)) {
    return TenantUploadQuota(tenant, bytes, own.total_bytes(),
                             kRetryUploadQuota);
  }
  const MemoryBudget& all = budgets_->whole();
  if (bytes > all.total_bytes() - (all.reserved_bytes() - kept)) {
    return UploadQuota(bytes, kRetryUploadQuota);
  }
  return absl::OkStatus();
}

void MemoryPartialUploads::Keep(const BlobKey& key, PartialUpload upload) {
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
  if (entries_.size() > kMaxKept) {
    dropped = ExtractOldestOf(LargestTenant(&Kept::count));
  }
}

absl::StatusOr<PartialUpload> MemoryPartialUploads::Take(const BlobKey& key) {
  Entries::node_type taken;  // its timer is freed after the lock
  {
    MutexLock lock(mutex_);
    taken = entries_.extract(key);
  }
  return taken ? std::move(taken.mapped().upload) : PartialUpload();
}

std::vector<std::size_t> MemoryPartialUploads::ReceivedBytes(
    const std::string& tenant, const std::vector<std::string>& sha256s) const {
  std::vector<std::size_t> received;
  MutexLock lock(mutex_);
  for (const std::string& sha256 : sha256s) {
    const auto found = entries_.find({tenant, sha256});
    received.push_back(
        found == entries_.end() ? 0 : found->second.upload.bytes.size());
  }
  return received;
}

void MemoryPartialUploads::Clear() {
  Entries dropped;
  MutexLock lock(mutex_);
  dropped.swap(entries_);
}

void MemoryPartialUploads::Expire(const BlobKey& key, std::uint64_t age_order) {
  Entries::node_type expired;
  MutexLock lock(mutex_);
  const auto found = entries_.find(key);
  if (found == entries_.end() || found->second.age_order != age_order) return;
  expired = entries_.extract(found);
}

absl::Status MemoryPartialUploads::DropOneFor(const std::string& tenant,
                                              std::int64_t bytes) {
  Entries::node_type dropped;
  MutexLock lock(mutex_);
  ISOMATCH_RETURN_IF_ERROR(CheckRoomLocked(tenant, bytes));
  const MemoryBudget& own = budgets_->Of(tenant);
  const bool is_share_full = bytes > own.total_bytes() - own.reserved_bytes();
  dropped =
      ExtractOldestOf(is_share_full ? tenant : LargestTenant(&Kept::bytes));
  return absl::OkStatus();  // none: others have just given theirs back
}

MemoryPartialUploads::Entries::node_type MemoryPartialUploads::ExtractOldestOf(
    const std::string& tenant) {
  auto oldest = entries_.end();
  for (auto entry = entries_.begin(); entry != entries_.end(); ++entry) {
    if (entry->first.tenant != tenant) continue;
    if (oldest == entries_.end() ||
        entry->second.age_order < oldest->second.age_order) {
      oldest = entry;
    }
  }
  if (oldest == entries_.end()) return {};
  return entries_.extract(oldest);
}

template <typename Measure>
std::string MemoryPartialUploads::LargestTenant(Measure Kept::*measure) const {
  const std::map<std::string, Kept> kept = KeptByTenant();
  const auto largest = std::max_element(
      kept.begin(), kept.end(), [&](const auto& a, const auto& b) {
        return a.second.*measure < b.second.*measure;
      });
  return largest == kept.end() ? "" : largest->first;
}

std::map<std::string, MemoryPartialUploads::Kept>
MemoryPartialUploads::KeptByTenant() const {
  std::map<std::string, Kept> kept;
  for (const auto& [key, entry] : entries_) {
    Kept& own = kept[key.tenant];
    ++own.count;
    own.bytes += entry.upload.reservation.bytes();
  }
  return kept;
}

}  // namespace isomatch
