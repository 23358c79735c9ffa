#include "server/storage/blob_store.h"

#include <utility>

#include "absl/strings/str_cat.h"

namespace isomatch {

absl::Status BlobStore::PutWithin(std::int64_t tenant_limit, const BlobKey& key,
                                  std::string bytes, Keep keep) {
  if (tenant_limit == 0) return Put(key, std::move(bytes), keep);
  const auto size = static_cast<std::int64_t>(bytes.size());
  MutexLock lock(PutWithinMutex(key.tenant));
  if (!MakeTenantRoom(key, size, tenant_limit)) {
    return absl::FailedPreconditionError(
        absl::StrCat("no room for ", size, " bytes within ", tenant_limit));
  }
  return Put(key, std::move(bytes), keep);
}

absl::StatusOr<std::vector<bool>> BlobStore::AreThere(
    const std::string& tenant, const std::vector<std::string>& sha256s) {
  std::vector<bool> are_there;
  for (const std::string& sha256 : sha256s) {
    are_there.push_back(Has({tenant, sha256}));
  }
  return are_there;
}

Mutex& BlobStore::PutWithinMutex(const std::string& tenant) {
  MutexLock lock(mutex_);
  return put_within_[tenant];
}

}  // namespace isomatch
