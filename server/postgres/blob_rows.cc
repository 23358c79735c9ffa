#include "server/postgres/blob_rows.h"

#include "core/base/status_macros.h"
#include "server/postgres/chunk_rows.h"

namespace isomatch {
namespace {

constexpr char kBlobChunks[] = "isomatch.blob_chunks";

using Repeat = PostgresPool::Repeat;

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
  InsertChunks(transaction, kBlobChunks, key, bytes);
}

absl::StatusOr<std::string> BlobRows::Read(const BlobKey& key,
                                           const BlobPlace& place) {
  std::string bytes;
  bytes.reserve(static_cast<size_t>(place.bytes));
  for (int first = 0; first < place.chunks; first += kChunksAtOnce) {
    const absl::Status read = pool_.RunAlone(
        [&](pqxx::nontransaction& database) {
          AppendChunks(database, kBlobChunks, key, first, bytes);
          return absl::OkStatus();
        },
        Repeat::kOnce);
    if (absl::IsDataLoss(read)) return read;
    ISOMATCH_RETURN_IF_ERROR(BlobStorageError(read));
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
