#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "core/base/mutex.h"
#include "server/postgres/blob_cache.h"
#include "server/postgres/blob_content.h"
#include "server/postgres/blob_folder.h"
#include "server/postgres/blob_rows.h"
#include "server/postgres/postgres_pool.h"
#include "server/storage/blob_store.h"

namespace isomatch {

/// Blobs in the tables of server/postgres/schema/002_blobs.sql, which any
/// number of processes may share, with their content there or in files. Knows
/// none by itself, but for a cache. Thread-safe.
///
/// Pins are no counters of a process here. What stays is
///  - what a row of isomatch.job_blobs names, until the job store removes it;
///  - what was used within `grace`, or where room is needed `room_grace`: so
///    long after Put or Pin there may be such a row. CanMakeRoom counts it as
///    what may go.
/// So Keep makes no difference, Unpin does nothing, and Remove leaves alone
/// what is needed. What was just used Tidy removes later, unless it is put or
/// used again.
///
/// The limits of capacity and tenant hold for what is put in turn. What several
/// put at the same time they may exceed by that much: none waits until the
/// other has sent its bytes, except for PutWithin in one process.
///
/// Has and HasWhole say false when the database does not answer: Put and Get,
/// which may follow, return UNAVAILABLE then. Pin, MakeTenantRoom and
/// CanMakeRoom say true, since what follows them would otherwise blame the
/// user: inserting the job, or Put, fails then.
class PostgresBlobStore : public BlobStore {
 public:
  struct Options {
    std::int64_t capacity_bytes = 0;
    /// How long after its last use nobody removes a blob. At least
    /// `use_resolution`, so that what Get takes from the cache is still there.
    absl::Duration grace = absl::Minutes(10);
    /// The same where room is needed: a job is made within a minute of what it
    /// needs. At least `use_resolution` longer than that.
    absl::Duration room_grace = absl::Minutes(2);
    /// Bytes of blobs in memory, which spare the database to send them again.
    std::int64_t cache_bytes = 0;
    /// Of files with content, see BlobFolder; empty for none: then those that
    /// are in files cannot be read.
    std::string folder = "";
    /// Whether new content goes there; otherwise into rows.
    bool puts_into_folder = true;
    /// A use is written only if the last one was so long ago; in between Get
    /// answers from the cache without asking.
    absl::Duration use_resolution = absl::Minutes(1);
    /// How old the answers of size_bytes and CanMakeRoom may be.
    absl::Duration figures_age = absl::Seconds(1);
  };

  /// REQUIRES: the pool outlives the store, and Migrate was done.
  PostgresBlobStore(PostgresPool* pool, const Options& options);

  /// Whether the folder can be used, if there is one. UNAVAILABLE.
  absl::Status Check();

  absl::Status Put(const BlobKey& key, std::string bytes, Keep keep) override;
  bool Pin(const BlobKey& key) override;
  void Unpin(const BlobKey& /*key*/) override {}
  absl::StatusOr<Blob> Get(const BlobKey& key) override;
  void Remove(const BlobKey& key) override;
  void Tidy() override;
  bool Has(const BlobKey& key) override;
  absl::StatusOr<std::vector<bool>> AreThere(
      const std::string& tenant,
      const std::vector<std::string>& sha256s) override;
  bool MakeTenantRoom(const BlobKey& key, std::int64_t bytes,
                      std::int64_t limit) override;
  bool CanMakeRoom(std::int64_t bytes) const override;
  absl::Status TryWriting(std::int64_t bytes) override;
  std::int64_t size_bytes() const override;

 private:
  /// What use_blob tells of one that is there.
  struct Found {
    BlobPlace place;
    std::int64_t version = 0;
  };

  /// A sum over a table, which is not read again for a while. Thread-safe.
  class Figure {
   public:
    explicit Figure(absl::Duration max_age)
        : max_age_(absl::ToChronoMicroseconds(max_age)) {}

    /// Returns what `ask` reads, or has read; the old one when the database
    /// does not answer, if there is one.
    std::optional<std::int64_t> Read(
        const std::function<absl::StatusOr<pqxx::result>()>& ask);

   private:
    const std::chrono::microseconds max_age_;
    Mutex mutex_;
    std::optional<std::int64_t> bytes_ ABSL_GUARDED_BY(mutex_);
    std::chrono::steady_clock::time_point read_at_ ABSL_GUARDED_BY(mutex_);
  };

  /// Counts as a use. NOT_FOUND; UNAVAILABLE.
  absl::StatusOr<Found> Use(const BlobKey& key);

  /// Inserts the blob, whose room was made, unless it is there.
  absl::Status Insert(const BlobKey& key, const std::string& bytes);

  /// Whose bytes make room, and within what.
  struct Room {
    bool of_tenant = false;
    std::int64_t limit_bytes = 0;
  };
  /// RESOURCE_EXHAUSTED: there is none; or UNAVAILABLE.
  absl::Status MakeRoom(const BlobKey& key, std::int64_t bytes, Room room);

  /// Get, without the cache; `known` if not null, once it is known to be there.
  absl::StatusOr<Blob> Fetch(const BlobKey& key, Blob known);

  /// Reads the content and checks it. DATA_LOSS: it is not what was put, or was
  /// removed meanwhile; UNAVAILABLE.
  absl::StatusOr<std::string> Read(const BlobKey& key, const BlobPlace& place);

  /// From now on it is as good as missing, unless it was put again meanwhile.
  absl::Status SetDamaged(const BlobKey& key, const Found& found);

  PostgresPool& pool_;
  const Options options_;
  const std::chrono::microseconds use_resolution_ =
      absl::ToChronoMicroseconds(options_.use_resolution);
  BlobCache cache_;
  BlobRows rows_;
  const std::unique_ptr<BlobFolder> files_;  // may be null
  BlobContent* const content_of_new_;
  mutable Figure total_{options_.figures_age};
  mutable Figure unused_{options_.figures_age};
};

}  // namespace isomatch
