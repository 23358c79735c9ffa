#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "absl/status/status.h"

namespace isomatch {

/// How long a blob stays.
enum class Keep {
  /// Until others need the room; the least recently used go first.
  kWhileRoom,
  /// Until Unpin was called as often as the blob was put this way.
  kPinned,
};

/// Bytes under the SHA-256 of their content: uploaded meshes and results.
/// Thread-safe.
class BlobStore {
 public:
  using Blob = std::shared_ptr<const std::string>;

  virtual ~BlobStore() = default;

  /// Stores `bytes`; content that is there already is kept once.
  /// REQUIRES: sha256 == Sha256Hex(bytes). RESOURCE_EXHAUSTED: there is no room
  /// even without all that may go.
  virtual absl::Status Put(const std::string& sha256, std::string bytes,
                           Keep keep) = 0;

  /// Takes back one kPinned; nothing when there is none.
  virtual void Unpin(const std::string& sha256) = 0;

  /// Returns the bytes, or null. Counts as a use.
  virtual Blob Get(const std::string& sha256) = 0;

  /// Bytes of all blobs.
  virtual std::int64_t size_bytes() const = 0;
};

}  // namespace isomatch
