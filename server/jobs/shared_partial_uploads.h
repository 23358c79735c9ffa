#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "server/jobs/partial_uploads.h"
#include "server/jobs/tenant_budgets.h"
#include "server/storage/upload_store.h"

namespace isomatch {

/// Those of all processes that share a store: uploads go on at any of them.
/// What is kept takes no room here. Thread-safe.
class SharedPartialUploads : public PartialUploads {
 public:
  /// Both outlive this object.
  SharedPartialUploads(TenantBudgets* budgets, UploadStore* store)
      : budgets_(budgets), store_(*store) {}

  bool AsksTheDisk() const override { return true; }
  absl::StatusOr<MemoryBudget::Reservation> Reserve(
      const std::string& tenant, std::int64_t bytes) override;
  absl::Status CheckRoom(const std::string& tenant,
                         std::int64_t bytes) const override;
  void Keep(const BlobKey& key, PartialUpload upload) override;
  absl::StatusOr<PartialUpload> Take(const BlobKey& key) override;
  void Forget(const BlobKey& key) override;
  std::vector<std::size_t> ReceivedBytes(
      const std::string& tenant,
      const std::vector<std::string>& sha256s) const override;

 private:
  TenantBudgets* const budgets_;
  UploadStore& store_;
};

/// Returns those of `store`, or when it is null those of this process, which
/// are kept for so long. All outlive what is returned.
std::unique_ptr<PartialUploads> MakePartialUploads(UploadStore* store,
                                                   TenantBudgets* budgets,
                                                   Executor* timers,
                                                   absl::Duration keep_for);

}  // namespace isomatch
