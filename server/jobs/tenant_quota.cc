#include "server/jobs/tenant_quota.h"

#include "server/jobs/errors.h"

namespace isomatch {

absl::Status MakeTenantRoom(BlobStore& blobs, const BlobKey& key,
                            std::int64_t size_bytes, std::int64_t limit_bytes) {
  if (limit_bytes == 0 || blobs.MakeTenantRoom(key, size_bytes, limit_bytes)) {
    return absl::OkStatus();
  }
  return StorageQuota(key.tenant, size_bytes, limit_bytes);
}

}  // namespace isomatch
