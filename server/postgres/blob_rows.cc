#include "server/postgres/blob_rows.h"

#include <algorithm>

#include "absl/strings/string_view.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

/// Bytes of a row of blob_chunks.
constexpr std::int64_t kChunkBytes = 256 * 1024;
/// Rows that one statement writes or reads: 4 MiB, so that it ends in time, and
/// neither side needs memory for much more than the blob.
constexpr int kChunksAtOnce = 16;

using Repeat = PostgresPool::Repeat;

int CountChunks(std::int64_t bytes) {
  return static_cast<int>((bytes + kChunkBytes - 1) / kChunkBytes);
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

absl::Status BlobStorageError(const absl::Status& status) {
  if (status.ok() || absl::IsResourceExhausted(status)) return status;
  return absl::UnavailableError(status.message());
}

absl::StatusOr<BlobPlace> BlobRows::Write(const BlobKey& /*key*/,
                                          const std::string& bytes) {
  const auto size = static_cast<std::int64_t>(bytes.size());
  return BlobPlace{.bytes = size, .chunks = CountChunks(size)};
}

void BlobRows::Insert(pqxx::work& transaction, const BlobKey& key,
                      const std::string& bytes) {
  const int chunks = CountChunks(static_cast<std::int64_t>(bytes.size()));
  for (int first = 0; first < chunks; first += kChunksAtOnce) {
    InsertChunks(transaction, key, bytes, first);
  }
}

absl::StatusOr<std::string> BlobRows::Read(const BlobKey& key,
                                           const BlobPlace& place) {
  std::string bytes;
  bytes.reserve(static_cast<size_t>(place.bytes));
  for (int first = 0; first < place.chunks; first += kChunksAtOnce) {
    // Hexadecimal digits whatever the database's bytea_output is: libpqxx
    // cannot ask for binary results.
    const auto rows = pool_.Ask(
        Repeat::kOnce,
        "SELECT encode(content, 'hex') FROM isomatch.blob_chunks "
        "WHERE tenant = $1 AND sha256 = $2 AND index >= $3 AND index < $4 "
        "ORDER BY index",
        key.tenant, key.sha256, first, first + kChunksAtOnce);
    if (absl::IsDataLoss(rows.status())) return rows.status();
    ISOMATCH_RETURN_IF_ERROR(BlobStorageError(rows.status()));
    for (const pqxx::row& row : *rows) {
      AppendHex({row[0].c_str(), row[0].size()}, bytes);
    }
  }
  return bytes;
}

absl::Status BlobRows::TryWriting(std::int64_t bytes) {
  const absl::Status status = pool_.Run([&](pqxx::work& transaction) {
    transaction.exec_params(
        "INSERT INTO isomatch.blob_probe (content) "
        "SELECT convert_to(repeat('x', $1::int), 'UTF8') "
        "FROM generate_series(1, $2::int)",
        kChunkBytes, CountChunks(bytes) + 1);
    return absl::CancelledError("to be taken back");
  });
  return absl::IsCancelled(status) ? absl::OkStatus()
                                   : BlobStorageError(status);
}

}  // namespace isomatch
