#include "server/postgres/postgres_blob_store.h"

#include <algorithm>
#include <memory>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "core/base/sha256.h"
#include "core/base/status_macros.h"
#include "server/postgres/job_rows.h"

namespace isomatch {
namespace {

/// Blobs that one statement of Tidy removes, and statements of one Tidy: the
/// other chores wait for it.
constexpr int kRemovedAtOnce = 100;
constexpr int kMostRemovals = 20;
/// How often Get reads what others put again meanwhile.
constexpr int kAttempts = 5;

using Repeat = PostgresPool::Repeat;
using SteadyClock = std::chrono::steady_clock;

}  // namespace

PostgresBlobStore::PostgresBlobStore(PostgresPool* pool, const Options& options)
    : pool_(*pool),
      options_(options),
      cache_(options.cache_bytes),
      rows_(pool),
      files_(options.folder.empty()
                 ? nullptr
                 : std::make_unique<BlobFolder>(pool, options.folder)),
      content_of_new_(files_ != nullptr && options.puts_into_folder
                          ? static_cast<BlobContent*>(files_.get())
                          : &rows_) {}

absl::Status PostgresBlobStore::Check() {
  if (files_ != nullptr) return files_->Check();
  const auto rows =
      pool_.Ask(Repeat::kOnce,
                "SELECT mark FROM isomatch.blob_folder WHERE EXISTS "
                "(SELECT FROM isomatch.blobs WHERE file IS NOT NULL)");
  ISOMATCH_RETURN_IF_ERROR(BlobStorageError(rows.status()));
  if (rows->empty()) return absl::OkStatus();
  return absl::FailedPreconditionError(absl::StrCat(
      "--blob-dir is not set, expected the folder that has the files of this "
      "database: its file isomatch-blobs says ",
      rows->front()[0].as<std::string>()));
}

absl::Status PostgresBlobStore::Put(const BlobKey& key, std::string bytes,
                                    Keep /*keep*/) {
  absl::Status used = Use(key).status();
  if (!absl::IsNotFound(used)) return used;
  ISOMATCH_RETURN_IF_ERROR(MakeRoom(key,
                                    static_cast<std::int64_t>(bytes.size()),
                                    {.limit_bytes = options_.capacity_bytes}));
  return Insert(key, bytes);
}

absl::Status PostgresBlobStore::Insert(const BlobKey& key,
                                       const std::string& bytes) {
  BlobContent& content = *content_of_new_;
  ISOMATCH_ASSIGN_OR_RETURN(const BlobPlace place, content.Write(key, bytes));
  bool is_there = false;
  const absl::Status put = pool_.Run([&](pqxx::work& transaction) {
    const pqxx::result more = transaction.exec_params(
        "SELECT isomatch.put_blob($1, $2, $3, $4, nullif($5, ''))", key.tenant,
        key.sha256, place.bytes, place.chunks, place.file);
    is_there = more[0][0].is_null();
    if (is_there) return absl::OkStatus();
    content.Insert(transaction, key, bytes);
    transaction.exec_params("SELECT isomatch.count_blob_bytes($1, $2)",
                            key.tenant, more[0][0].as<std::int64_t>());
    return absl::OkStatus();
  });
  // After an error the row may be there nevertheless.
  if (put.ok() && is_there) content.TakeBack(place);
  return BlobStorageError(put);
}

absl::Status PostgresBlobStore::MakeRoom(const BlobKey& key, std::int64_t bytes,
                                         Room room) {
  constexpr int kMostAttempts = 20;
  constexpr absl::Duration kPause = absl::Milliseconds(10);
  int attempts_in_vain = 0;
  for (;;) {
    const auto missing = pool_.Ask(
        Repeat::kOnce,
        "SELECT isomatch.make_blob_room($1, $2, $3, $4, $5, $6::interval)",
        key.tenant, key.sha256, bytes, room.limit_bytes, room.of_tenant,
        IntervalOf(std::min(options_.grace, options_.room_grace)));
    ISOMATCH_RETURN_IF_ERROR(BlobStorageError(missing.status()));
    const pqxx::row row = missing->front();
    const bool is_locked = !row[0].is_null() && row[0].as<std::int64_t>() < 0;
    if (is_locked && ++attempts_in_vain < kMostAttempts) {
      absl::SleepFor(kPause);
      continue;
    }
    if (row[0].is_null() || is_locked) {
      return absl::ResourceExhaustedError(
          absl::StrCat("no room for ", bytes, " bytes of ", room.limit_bytes,
                       " beside those that are needed"));
    }
    if (row[0].as<std::int64_t>() == 0) break;
  }
  content_of_new_->RemoveDropped();
  return absl::OkStatus();
}

bool PostgresBlobStore::MakeTenantRoom(const BlobKey& key, std::int64_t bytes,
                                       std::int64_t limit) {
  if (Has(key)) return true;
  return !absl::IsResourceExhausted(
      MakeRoom(key, bytes, {.of_tenant = true, .limit_bytes = limit}));
}

absl::StatusOr<PostgresBlobStore::Found> PostgresBlobStore::Use(
    const BlobKey& key) {
  const auto rows =
      pool_.Ask(Repeat::kOnce,
                "SELECT bytes, chunks, file, version "
                "FROM isomatch.use_blob($1, $2, $3::interval)",
                key.tenant, key.sha256, IntervalOf(options_.use_resolution));
  ISOMATCH_RETURN_IF_ERROR(BlobStorageError(rows.status()));
  if (rows->empty()) return absl::NotFoundError(key.sha256);
  const pqxx::row row = rows->front();
  return Found{
      {row[0].as<std::int64_t>(), row[1].as<int>(), row[2].as<std::string>("")},
      row[3].as<std::int64_t>()};
}

bool PostgresBlobStore::Pin(const BlobKey& key) {
  return !absl::IsNotFound(Use(key).status());
}

bool PostgresBlobStore::Has(const BlobKey& key) { return Use(key).ok(); }

absl::StatusOr<std::vector<bool>> PostgresBlobStore::AreThere(
    const std::string& tenant, const std::vector<std::string>& sha256s) {
  const auto rows = pool_.Ask(
      Repeat::kOnce, "SELECT isomatch.use_blobs($1, $2, $3::interval)", tenant,
      ArrayOf(sha256s), IntervalOf(options_.use_resolution));
  ISOMATCH_RETURN_IF_ERROR(BlobStorageError(rows.status()));
  std::set<std::string> found;
  for (const pqxx::row& row : *rows) found.insert(row[0].as<std::string>());
  std::vector<bool> are_there;
  are_there.reserve(sha256s.size());
  for (const std::string& sha256 : sha256s) {
    are_there.push_back(found.count(sha256) > 0);
  }
  return are_there;
}

absl::StatusOr<BlobStore::Blob> PostgresBlobStore::Get(const BlobKey& key) {
  const std::optional<BlobCache::Entry> cached = cache_.Find(key);
  const SteadyClock::time_point now = SteadyClock::now();
  if (cached && now - cached->known_at < use_resolution_) return cached->blob;
  absl::StatusOr<Blob> blob = Fetch(key, cached ? cached->blob : nullptr);
  if (blob.ok()) cache_.Put({key, *blob, now});
  if (absl::IsNotFound(blob.status())) cache_.Remove(key);
  return blob;
}

absl::StatusOr<BlobStore::Blob> PostgresBlobStore::Fetch(const BlobKey& key,
                                                         Blob known) {
  for (int attempt = 0; attempt < kAttempts; ++attempt) {
    ISOMATCH_ASSIGN_OR_RETURN(const Found found, Use(key));
    if (known != nullptr) return known;
    absl::StatusOr<std::string> bytes = Read(key, found.place);
    if (bytes.ok()) {
      return std::make_shared<const std::string>(*std::move(bytes));
    }
    if (!absl::IsDataLoss(bytes.status())) return bytes.status();
    // Now it is missing, or somebody has put it again.
    ISOMATCH_RETURN_IF_ERROR(SetDamaged(key, found));
  }
  return absl::UnavailableError(
      absl::StrCat(key.sha256, " was put again and again while it was read"));
}

absl::StatusOr<std::string> PostgresBlobStore::Read(const BlobKey& key,
                                                    const BlobPlace& place) {
  BlobContent* content = &rows_;
  if (!place.file.empty()) content = files_.get();
  if (content == nullptr) {
    return absl::UnavailableError(absl::StrCat(
        key.sha256, " is in the file ", place.file, ", expected --blob-dir"));
  }
  ISOMATCH_ASSIGN_OR_RETURN(std::string bytes, content->Read(key, place));
  if (Sha256Hex(bytes) != key.sha256) return absl::DataLossError(key.sha256);
  return bytes;
}

absl::Status PostgresBlobStore::SetDamaged(const BlobKey& key,
                                           const Found& found) {
  return BlobStorageError(
      pool_
          .Ask(Repeat::kOnce,
               "UPDATE isomatch.blobs SET is_damaged = true "
               "WHERE tenant = $1 AND sha256 = $2 "
               "AND (extract(epoch FROM put_at) * 1000000)::bigint = $3",
               key.tenant, key.sha256, found.version)
          .status());
}

void PostgresBlobStore::Remove(const BlobKey& key) {
  (void)pool_.Ask(Repeat::kOnce,
                  "SELECT isomatch.remove_blob($1, $2, $3::interval)",
                  key.tenant, key.sha256, IntervalOf(options_.grace));
  cache_.Remove(key);
  if (files_ != nullptr) files_->RemoveDropped();
}

void PostgresBlobStore::Tidy() {
  int removed = kRemovedAtOnce;
  for (int i = 0; i < kMostRemovals && removed == kRemovedAtOnce; ++i) {
    const auto rows =
        pool_.Ask(Repeat::kOnce, "SELECT isomatch.remove_due_blobs($1, $2)",
                  IntervalOf(options_.grace), kRemovedAtOnce);
    removed = rows.ok() ? rows->front()[0].as<int>() : 0;
  }
  if (files_ != nullptr) files_->Tidy();
}

absl::Status PostgresBlobStore::TryWriting(std::int64_t bytes) {
  if (content_of_new_ == &rows_) return rows_.TryWriting(bytes);
  ISOMATCH_RETURN_IF_ERROR(content_of_new_->TryWriting(bytes));
  return rows_.TryWriting(0);
}

bool PostgresBlobStore::CanMakeRoom(std::int64_t bytes) const {
  const std::int64_t most = options_.capacity_bytes - bytes;
  if (size_bytes() <= most) return true;
  // Also what may go in a moment only.
  const std::optional<std::int64_t> unused = unused_.Read([this] {
    return pool_.Ask(Repeat::kOnce,
                     "SELECT coalesce(sum(bytes), 0)::bigint "
                     "FROM isomatch.unused_blobs");
  });
  return !unused || size_bytes() - *unused <= most;
}

std::int64_t PostgresBlobStore::size_bytes() const {
  const std::optional<std::int64_t> total = total_.Read([this] {
    return pool_.Ask(Repeat::kOnce,
                     "SELECT coalesce(sum(bytes), 0)::bigint "
                     "FROM isomatch.blob_totals");
  });
  return total.value_or(0);
}

std::optional<std::int64_t> PostgresBlobStore::Figure::Read(
    const std::function<absl::StatusOr<pqxx::result>()>& ask) {
  const SteadyClock::time_point now = SteadyClock::now();
  {
    MutexLock lock(mutex_);
    if (bytes_ && now - read_at_ < max_age_) return bytes_;
  }
  const absl::StatusOr<pqxx::result> rows = ask();
  MutexLock lock(mutex_);
  if (rows.ok()) {
    bytes_ = rows->front()[0].as<std::int64_t>();
    read_at_ = now;
  }
  return bytes_;
}

}  // namespace isomatch
