#pragma once

#include <compare>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/base/mutex.h"

namespace isomatch {

/// How long a blob stays.
enum class Keep {
  /// Until others need the room; the least recently used go first.
  kWhileRoom,
  /// Until Unpin was called as often as the blob was put this way.
  kPinned,
};

/// What a blob is found by. Each tenant has its own, so that nobody learns what
/// others have stored.
struct BlobKey {
  /// As Caller::tenant.
  std::string tenant;
  /// SHA-256 of the content, 64 lower-case hexadecimal digits.
  std::string sha256;

  auto operator<=>(const BlobKey&) const = default;  // NOLINT: not a pointer
};

/// Bytes under the SHA-256 of their content: uploaded meshes, requests and
/// results. Pins live as long as the process: whoever starts again pins again.
/// Thread-safe.
class BlobStore {
 public:
  using Blob = std::shared_ptr<const std::string>;

  virtual ~BlobStore() = default;

  /// Stores `bytes`; content that is there already, and undamaged, is kept
  /// once.
  /// REQUIRES: key.sha256 == Sha256Hex(bytes). RESOURCE_EXHAUSTED: there is no
  /// room even without all that may go. UNAVAILABLE: the disk refuses.
  virtual absl::Status Put(const BlobKey& key, std::string bytes,
                           Keep keep) = 0;

  /// As Put, but FAILED_PRECONDITION when MakeTenantRoom finds no room within
  /// `tenant_limit` (0: no limit), also with all else that arrives this way.
  absl::Status PutWithin(std::int64_t tenant_limit, const BlobKey& key,
                         std::string bytes, Keep keep);

  /// As Put of what is there already with kPinned; false when it is not there.
  virtual bool Pin(const BlobKey& key) = 0;

  /// As Pin, but what is not found is pinned from when it is: for those who
  /// call Unpin either way, and would take back the pin of others.
  virtual void PinWhenThere(const BlobKey& key) { (void)Pin(key); }

  /// Takes back one kPinned; nothing when there is none.
  virtual void Unpin(const BlobKey& key) = 0;

  /// Returns the bytes, never null. Counts as a use. NOT_FOUND: they are not
  /// there, or damaged, until somebody puts them again; UNAVAILABLE: they are,
  /// as far as is known, but cannot be read just now.
  virtual absl::StatusOr<Blob> Get(const BlobKey& key) = 0;

  /// Removes what is not pinned; nothing when it is not there. A store that
  /// cannot yet leaves it to Tidy, unless it is used meanwhile.
  virtual void Remove(const BlobKey& key) = 0;

  /// Removes what could not go before. To be called once a minute, by one of
  /// the processes that share the store.
  virtual void Tidy() {}

  /// Whether it is there, as far as is known without reading it. Counts as a
  /// use.
  virtual bool Has(const BlobKey& key) = 0;

  /// As Has of each of a tenant's blobs. UNAVAILABLE: it is not known just now.
  virtual absl::StatusOr<std::vector<bool>> AreThere(
      const std::string& tenant, const std::vector<std::string>& sha256s);

  /// As Has, but reads it first, unless that was done a moment ago.
  virtual bool HasWhole(const BlobKey& key) { return Has(key); }

  /// Removes blobs of the key's tenant that are neither pinned nor in use, the
  /// least recently used first, until its others and `bytes` for this one are
  /// at most `limit`; nothing when Has finds it already. False, and nothing is
  /// removed, when that cannot be.
  virtual bool MakeTenantRoom(const BlobKey& key, std::int64_t bytes,
                              std::int64_t limit) = 0;

  /// Whether Put would find this much room by removing what may go, wherever
  /// the bytes are kept.
  virtual bool CanMakeRoom(std::int64_t bytes) const = 0;

  /// Whether the disk takes as many bytes, and some more; they are removed
  /// again. Errors as Put.
  virtual absl::Status TryWriting(std::int64_t /*bytes*/) {
    return absl::OkStatus();
  }

  /// Bytes of all blobs.
  virtual std::int64_t size_bytes() const = 0;

 private:
  /// Returns the tenant's lock, which is held from asking for room to having
  /// used it. Others need not wait for its disk.
  Mutex& PutWithinMutex(const std::string& tenant);

  Mutex mutex_;
  std::map<std::string, Mutex> put_within_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace isomatch
