#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <utility>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "core/base/mutex.h"
#include "server/jobs/executor.h"
#include "server/jobs/memory_budget.h"
#include "server/storage/blob_store.h"

namespace isomatch {

/// What a client waits before it sends again what there was no room for.
inline constexpr absl::Duration kRetryUploadQuota = absl::Seconds(2);

/// The first bytes of a mesh, and their place in the budget.
struct PartialUpload {
  std::string bytes;
  MemoryBudget::Reservation reservation;
};

/// What uploads that broke off have brought, for a while, so that they can go
/// on there.
///
///   1. Bytes belong to one upload or are kept here, never both: Take removes
///      them. Two uploads of one mesh at a time share nothing; of what both
///      leave behind the longer is kept.
///   2. Bytes that are kept count against the budget. They give way, the oldest
///      first, when Reserve needs the room.
///   3. At most kMaxKept are kept, so that tiny ones cannot pile up.
///
/// Thread-safe. No lock is held while it calls others.
class PartialUploads {
 public:
  static constexpr std::size_t kMaxKept = 1000;

  /// Both outlive this object, except that `timers` may be joined before.
  PartialUploads(MemoryBudget* budget, Executor* timers,
                 absl::Duration keep_for)
      : budget_(budget), timers_(timers), keep_for_(keep_for) {}

  /// Returns room for `bytes` of unfinished uploads and requests.
  /// RESOURCE_EXHAUSTED (UPLOAD_QUOTA) when there is none, even without all
  /// that is kept. REQUIRES: bytes >= 0.
  absl::StatusOr<MemoryBudget::Reservation> Reserve(std::int64_t bytes);

  /// Keeps what an upload has brought, and no more room than that needs.
  void Keep(const BlobKey& key, PartialUpload upload);

  /// Removes and returns what is kept; empty when there is nothing.
  PartialUpload Take(const BlobKey& key);

  /// Returns the number of bytes that are kept.
  std::size_t ReceivedBytes(const BlobKey& key) const;

  /// Drops all, so that `timers` can be joined without waiting for them.
  void Clear();

 private:
  struct Entry {
    PartialUpload upload;
    /// Grows from one Keep to the next.
    std::uint64_t age_order = 0;
    Executor::Timer timer;
  };
  using Entries = std::map<BlobKey, Entry>;

  void Expire(const BlobKey& key, std::uint64_t age_order);

  /// Drops the oldest; false when there is none, or when dropping all would
  /// not make room for `bytes`.
  bool DropOldestFor(std::int64_t bytes);

  /// Returns the oldest, to be freed without the lock. REQUIRES: not empty.
  Entries::node_type ExtractOldest() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  std::int64_t KeptBytes() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  MemoryBudget* const budget_;
  Executor* const timers_;
  const absl::Duration keep_for_;

  mutable Mutex mutex_;
  std::uint64_t last_age_order_ ABSL_GUARDED_BY(mutex_) = 0;
  Entries entries_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace isomatch
