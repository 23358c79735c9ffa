#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "server/storage/blob_store.h"

namespace isomatch {

/// What uploads that broke off have brought, for all processes that share a
/// store: the first bytes of a mesh, for a while. Thread-safe.
class UploadStore {
 public:
  virtual ~UploadStore() = default;

  /// What may be kept of all, and of one tenant.
  struct Limits {
    std::int64_t total_bytes = 0;
    std::int64_t tenant_bytes = 0;
  };

  /// Keeps `bytes`, unless as much of it is kept already; of what it begins
  /// with nothing is written again. Then removes the oldest of whoever has too
  /// much, or else most, until it is within `limits`. UNAVAILABLE;
  /// RESOURCE_EXHAUSTED: the disk is full.
  virtual absl::Status Keep(const BlobKey& key, absl::string_view bytes,
                            const Limits& limits) = 0;

  /// Returns what is kept; empty when there is nothing. UNAVAILABLE.
  virtual absl::StatusOr<std::string> Read(const BlobKey& key) = 0;

  /// Removes what is kept, if the store answers.
  virtual void Forget(const BlobKey& key) = 0;

  /// Returns the number of bytes that are kept of each of a tenant's uploads.
  /// UNAVAILABLE.
  virtual absl::StatusOr<std::vector<std::size_t>> ReceivedBytes(
      const std::string& tenant, const std::vector<std::string>& sha256s) = 0;

  /// Removes what was kept for long enough. To be called once a minute.
  virtual void Tidy() = 0;
};

}  // namespace isomatch
