#include "server/jobs/shared_partial_uploads.h"

#include <utility>

#include "core/base/status_macros.h"
#include "server/jobs/errors.h"

namespace isomatch {

absl::StatusOr<MemoryBudget::Reservation> SharedPartialUploads::Reserve(
    const std::string& tenant, std::int64_t bytes) {
  auto reserved = budgets_->Of(tenant).Reserve(bytes);
  if (reserved.ok()) return reserved;
  ISOMATCH_RETURN_IF_ERROR(CheckRoom(tenant, bytes));
  return UploadQuota(bytes, kRetryUploadQuota);  // there is room by now
}

absl::Status SharedPartialUploads::CheckRoom(const std::string& tenant,
                                             std::int64_t bytes) const {
  const MemoryBudget& own = budgets_->Of(tenant);
  if (bytes > own.total_bytes() - own.reserved_bytes()) {
    return TenantUploadQuota(tenant, bytes, own.total_bytes(),
                             kRetryUploadQuota);
  }
  const MemoryBudget& all = budgets_->whole();
  if (bytes > all.total_bytes() - all.reserved_bytes()) {
    return UploadQuota(bytes, kRetryUploadQuota);
  }
  return absl::OkStatus();
}

void SharedPartialUploads::Keep(const BlobKey& key, PartialUpload upload) {
  // Lost when the store does not answer: the upload starts over.
  if (upload.bytes.empty()) return;
  (void)store_.Keep(key, upload.bytes,
                    {.total_bytes = budgets_->whole().total_bytes(),
                     .tenant_bytes = budgets_->share_bytes()});
}

absl::StatusOr<PartialUpload> SharedPartialUploads::Take(const BlobKey& key) {
  PartialUpload taken;
  const auto received = store_.ReceivedBytes(key.tenant, {key.sha256});
  if (!received.ok()) return StorageFailed(received.status());
  const std::size_t kept = received->front();
  if (kept == 0) return taken;
  ISOMATCH_ASSIGN_OR_RETURN(
      taken.reservation, Reserve(key.tenant, static_cast<std::int64_t>(kept)));
  absl::StatusOr<std::string> bytes = store_.Read(key);
  if (!bytes.ok()) return StorageFailed(bytes.status());
  taken.bytes = *std::move(bytes);
  // Somebody else may have gone on with it, or ended it.
  if (taken.bytes.size() > kept) taken.bytes.resize(kept);
  taken.reservation.ShrinkTo(static_cast<std::int64_t>(taken.bytes.size()));
  return taken;
}

void SharedPartialUploads::Forget(const BlobKey& key) { store_.Forget(key); }

std::vector<std::size_t> SharedPartialUploads::ReceivedBytes(
    const std::string& tenant, const std::vector<std::string>& sha256s) const {
  return store_.ReceivedBytes(tenant, sha256s)
      .value_or(std::vector<std::size_t>(sha256s.size()));
}

std::unique_ptr<PartialUploads> MakePartialUploads(UploadStore* store,
                                                   TenantBudgets* budgets,
                                                   Executor* timers,
                                                   absl::Duration keep_for) {
  if (store != nullptr) {
    return std::make_unique<SharedPartialUploads>(budgets, store);
  }
  return std::make_unique<MemoryPartialUploads>(budgets, timers, keep_for);
}

}  // namespace isomatch
