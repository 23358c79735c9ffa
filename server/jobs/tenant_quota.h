#pragma once

#include <cstdint>

#include "absl/status/status.h"
#include "server/storage/blob_store.h"

namespace isomatch {

/// As BlobStore::MakeTenantRoom; RESOURCE_EXHAUSTED (STORAGE_QUOTA) when there
/// is no room. A `limit_bytes` of 0 is no limit.
absl::Status MakeTenantRoom(BlobStore& blobs, const BlobKey& key,
                            std::int64_t size_bytes, std::int64_t limit_bytes);

}  // namespace isomatch
