#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "core/base/mutex.h"
#include "server/jobs/memory_budget.h"
#include "server/jobs/tenant_budgets.h"
#include "server/machine/executor.h"
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
/// on there, and room for those that run. Thread-safe.
class PartialUploads {
 public:
  virtual ~PartialUploads() = default;

  /// Whether Keep, Take and ReceivedBytes wait for a database, so that gRPC's
  /// threads must not call them.
  virtual bool AsksTheDisk() const = 0;

  /// Returns room for `bytes` more of the tenant's unfinished uploads.
  /// RESOURCE_EXHAUSTED (UPLOAD_QUOTA) when there is none, even without all
  /// that may give way. REQUIRES: bytes >= 0.
  virtual absl::StatusOr<MemoryBudget::Reservation> Reserve(
      const std::string& tenant, std::int64_t bytes) = 0;

  /// Whether Reserve would find room now; nothing gives way.
  virtual absl::Status CheckRoom(const std::string& tenant,
                                 std::int64_t bytes) const = 0;

  /// Keeps what an upload has brought, and no more room than that needs.
  virtual void Keep(const BlobKey& key, PartialUpload upload) = 0;

  /// Returns what is kept, which stays only where that needs no room here;
  /// empty when there is nothing. UNAVAILABLE (STORAGE_FAILED),
  /// RESOURCE_EXHAUSTED (UPLOAD_QUOTA): it stays.
  virtual absl::StatusOr<PartialUpload> Take(const BlobKey& key) = 0;

  /// The upload is over, well or not: what stayed is of no use any more.
  virtual void Forget(const BlobKey& /*key*/) {}

  /// Returns the number of bytes that are kept of each of a tenant's uploads.
  virtual std::vector<std::size_t> ReceivedBytes(
      const std::string& tenant,
      const std::vector<std::string>& sha256s) const = 0;

  /// Drops what is kept in memory, so that timers can be joined without waiting
  /// for it.
  virtual void Clear() {}
};

/// Those of one process, in memory.
///
///   1. Bytes belong to one upload or are kept here, never both: Take removes
///      them. Two uploads of one mesh at a time share nothing; of what both
///      leave behind the longer is kept.
///   2. Bytes that are kept count against the budget, and their tenant's share
///      of it. They give way when Reserve needs the room: of the tenant, or
///      else of the one that has most, the oldest first.
///   3. At most kMaxKept are kept, so that tiny ones cannot pile up.
///
/// Thread-safe. No lock is held while it calls others.
class MemoryPartialUploads : public PartialUploads {
 public:
  static constexpr std::size_t kMaxKept = 1000;

  /// Both outlive this object, except that `timers` may be joined before.
  MemoryPartialUploads(TenantBudgets* budgets, Executor* timers,
                       absl::Duration keep_for)
      : budgets_(budgets), timers_(timers), keep_for_(keep_for) {}

  bool AsksTheDisk() const override { return false; }
  absl::StatusOr<MemoryBudget::Reservation> Reserve(
      const std::string& tenant, std::int64_t bytes) override;
  absl::Status CheckRoom(const std::string& tenant,
                         std::int64_t bytes) const override;
  void Keep(const BlobKey& key, PartialUpload upload) override;
  absl::StatusOr<PartialUpload> Take(const BlobKey& key) override;
  std::vector<std::size_t> ReceivedBytes(
      const std::string& tenant,
      const std::vector<std::string>& sha256s) const override;
  void Clear() override;

 private:
  struct Entry {
    PartialUpload upload;
    /// Grows from one Keep to the next.
    std::uint64_t age_order = 0;
    Executor::Timer timer;
  };
  using Entries = std::map<BlobKey, Entry>;

  void Expire(const BlobKey& key, std::uint64_t age_order);

  /// What is kept of one tenant, or of all.
  struct Kept {
    std::size_t count = 0;
    std::int64_t bytes = 0;
  };
  std::map<std::string, Kept> KeptByTenant() const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  absl::Status CheckRoomLocked(const std::string& tenant,
                               std::int64_t bytes) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  /// Drops one that gives way to `bytes` of the tenant. RESOURCE_EXHAUSTED when
  /// that cannot help.
  absl::Status DropOneFor(const std::string& tenant, std::int64_t bytes);

  /// Returns the tenant's oldest, to be freed without the lock; empty when it
  /// has none.
  Entries::node_type ExtractOldestOf(const std::string& tenant)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  /// Returns the tenant that keeps most by `measure`; empty for none.
  template <typename Measure>
  std::string LargestTenant(Measure Kept::*measure) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  TenantBudgets* const budgets_;
  Executor* const timers_;
  const absl::Duration keep_for_;

  mutable Mutex mutex_;
  std::uint64_t last_age_order_ ABSL_GUARDED_BY(mutex_) = 0;
  Entries entries_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace isomatch
