#include "server/postgres/postgres_blob_store.h"

#include <algorithm>
#include <memory>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "core/base/sha256.h"
#include "core/base/status_macros.h"
#include "server/postgres/job_rows.h"

namespace isomatch {
namespace {

/// Bytes of a row of blob_chunks.
constexpr std::int64_t kChunkBytes = 256 * 1024;
/// Rows that one statement writes or reads: 4 MiB, so that it ends in time, and
/// neither side needs memory for much more than the blob.
constexpr int kChunksAtOnce = 16;
/// Blobs that one statement of Tidy removes, and statements of one Tidy: the
/// other chores wait for it.
constexpr int kRemovedAtOnce = 100;
constexpr int kMostRemovals = 20;
/// How often Get reads what others put again meanwhile.
constexpr int kAttempts = 5;

using Repeat = PostgresPool::Repeat;
using SteadyClock = std::chrono::steady_clock;

int CountChunks(std::int64_t bytes) {
  return static_cast<int>((bytes + kChunkBytes - 1) / kChunkBytes);
}

/// What a BlobStore may say of an error of the database.
absl::Status StorageError(const absl::Status& status) {
  if (status.ok() || absl::IsResourceExhausted(status)) return status;
  return absl::UnavailableError(status.message());
}

/// Inserts the chunks from number `first` on, as many as one statement does.
void InsertChunks(pqxx::work& transaction, const BlobKey& key,
                  const std::string& bytes, int first) {
  const size_t begin = static_cast<size_t>(first) * kChunkBytes;
  const size_t size =
      std::min<size_t>(bytes.size() - begin, kChunksAtOnce * kChunkBytes);
  transaction.exec_params(
      "INSERT INTO isomatch.blob_chunks (tenant, sha256, index, content) "
      "SELECT $1, $2, $3::int + i, substr($4::bytea, i * $5::int + 1, $5::int) "
      "FROM generate_series(0, $6::int - 1) AS i",
      key.tenant, key.sha256, first,
      pqxx::binarystring(bytes.data() + begin, size), kChunkBytes,
      CountChunks(static_cast<std::int64_t>(size)));
}

/// Returns the value of a lower-case hexadecimal digit.
unsigned ValueOf(char digit) {
  return static_cast<unsigned char>(digit <= '9' ? digit - '0'
                                                 : digit - 'a' + 10);
}

void AppendHex(absl::string_view digits, std::string& bytes) {
  size_t at = bytes.size();
  bytes.resize(at + digits.size() / 2);
  for (size_t i = 0; i + 1 < digits.size(); i += 2) {
    bytes[at++] =
        static_cast<char>(ValueOf(digits[i]) * 16 + ValueOf(digits[i + 1]));
  }
}

}  // namespace

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
  const auto size = static_cast<std::int64_t>(bytes.size());
  const int chunks = CountChunks(size);
  return StorageError(pool_.Run([&](pqxx::work& transaction) {
    const pqxx::result put =
        transaction.exec_params("SELECT isomatch.put_blob($1, $2, $3, $4)",
                                key.tenant, key.sha256, size, chunks);
    if (put[0][0].is_null()) return absl::OkStatus();
    for (int first = 0; first < chunks; first += kChunksAtOnce) {
      InsertChunks(transaction, key, bytes, first);
    }
    transaction.exec_params("SELECT isomatch.count_blob_bytes($1, $2)",
                            key.tenant, put[0][0].as<std::int64_t>());
    return absl::OkStatus();
  }));
}

absl::Status PostgresBlobStore::MakeRoom(const BlobKey& key, std::int64_t bytes,
                                         Room room) {
  for (;;) {
    const auto missing = pool_.Ask(
        Repeat::kOnce,
        "SELECT isomatch.make_blob_room($1, $2, $3, $4, $5, $6::interval)",
        key.tenant, key.sha256, bytes, room.limit_bytes, room.of_tenant,
        IntervalOf(options_.grace));
    ISOMATCH_RETURN_IF_ERROR(StorageError(missing.status()));
    const pqxx::row row = missing->front();
    if (row[0].is_null()) {
      return absl::ResourceExhaustedError(
          absl::StrCat("no room for ", bytes, " bytes of ", room.limit_bytes,
                       " beside those that are needed"));
    }
    if (row[0].as<std::int64_t>() == 0) return absl::OkStatus();
  }
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
                "SELECT bytes, chunks, version "
                "FROM isomatch.use_blob($1, $2, $3::interval)",
                key.tenant, key.sha256, IntervalOf(options_.use_resolution));
  ISOMATCH_RETURN_IF_ERROR(StorageError(rows.status()));
  if (rows->empty()) return absl::NotFoundError(key.sha256);
  const pqxx::row row = rows->front();
  return Found{row[0].as<std::int64_t>(), row[1].as<int>(),
               row[2].as<std::int64_t>()};
}

bool PostgresBlobStore::Pin(const BlobKey& key) {
  return !absl::IsNotFound(Use(key).status());
}

bool PostgresBlobStore::Has(const BlobKey& key) { return Use(key).ok(); }

absl::StatusOr<bool> PostgresBlobStore::IsThere(const BlobKey& key) {
  const absl::Status used = Use(key).status();
  if (used.ok() || absl::IsNotFound(used)) return used.ok();
  return used;
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
    absl::StatusOr<std::string> bytes = Read(key, found);
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
                                                    const Found& found) {
  std::string bytes;
  bytes.reserve(static_cast<size_t>(found.bytes));
  for (int first = 0; first < found.chunks; first += kChunksAtOnce) {
    // Hexadecimal digits whatever the database's bytea_output is: libpqxx
    // cannot ask for binary results.
    const auto rows = pool_.Ask(
        Repeat::kOnce,
        "SELECT encode(content, 'hex') FROM isomatch.blob_chunks "
        "WHERE tenant = $1 AND sha256 = $2 AND index >= $3 AND index < $4 "
        "ORDER BY index",
        key.tenant, key.sha256, first, first + kChunksAtOnce);
    if (absl::IsDataLoss(rows.status())) return rows.status();
    ISOMATCH_RETURN_IF_ERROR(StorageError(rows.status()));
    for (const pqxx::row& row : *rows) {
      AppendHex({row[0].c_str(), row[0].size()}, bytes);
    }
  }
  if (Sha256Hex(bytes) != key.sha256) return absl::DataLossError(key.sha256);
  return bytes;
}

absl::Status PostgresBlobStore::SetDamaged(const BlobKey& key,
                                           const Found& found) {
  return StorageError(
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
}

void PostgresBlobStore::Tidy() {
  int removed = kRemovedAtOnce;
  for (int i = 0; i < kMostRemovals && removed == kRemovedAtOnce; ++i) {
    const auto rows =
        pool_.Ask(Repeat::kOnce, "SELECT isomatch.remove_due_blobs($1, $2)",
                  IntervalOf(options_.grace), kRemovedAtOnce);
    removed = rows.ok() ? rows->front()[0].as<int>() : 0;
  }
}

absl::Status PostgresBlobStore::TryWriting(std::int64_t bytes) {
  const absl::Status status = pool_.Run([&](pqxx::work& transaction) {
    transaction.exec_params(
        "INSERT INTO isomatch.blob_probe (content) "
        "SELECT convert_to(repeat('x', $1::int), 'UTF8') "
        "FROM generate_series(1, $2::int)",
        kChunkBytes, CountChunks(bytes) + 1);
    return absl::CancelledError("to be taken back");
  });
  return absl::IsCancelled(status) ? absl::OkStatus() : StorageError(status);
}

bool PostgresBlobStore::CanMakeRoom(std::int64_t bytes) const {
  const std::int64_t most = options_.capacity_bytes - bytes;
  if (size_bytes() <= most) return true;
  const std::optional<std::int64_t> unused = unused_.Read([this] {
    return pool_.Ask(Repeat::kOnce,
                     "SELECT coalesce(sum(bytes), 0)::bigint "
                     "FROM isomatch.unused_blobs "
                     "WHERE used_at <= now() - $1::interval",
                     IntervalOf(options_.grace));
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
