#include "server/postgres/postgres_upload_store.h"

#include <map>

#include <pqxx/pqxx>

#include "core/base/status_macros.h"
#include "server/postgres/blob_content.h"
#include "server/postgres/chunk_rows.h"
#include "server/postgres/job_rows.h"

namespace isomatch {
namespace {

constexpr char kPartialChunks[] = "isomatch.partial_chunks";

}  // namespace

absl::Status PostgresUploadStore::Keep(const BlobKey& key,
                                       absl::string_view bytes,
                                       const Limits& limits) {
  return BlobStorageError(pool_.Run([&](pqxx::work& transaction) {
    const pqxx::result kept = transaction.exec_params(
        "SELECT isomatch.keep_upload($1, $2, $3, $4, $5::interval)", key.tenant,
        key.sha256, static_cast<std::int64_t>(bytes.size()), kChunkBytes,
        IntervalOf(options_.kept_for));
    if (kept[0][0].is_null()) return absl::OkStatus();
    InsertChunks(transaction, kPartialChunks, key, bytes,
                 kept[0][0].as<std::size_t>());
    transaction.exec_params("SELECT isomatch.trim_uploads($1, $2, $3, $4)",
                            key.tenant, limits.tenant_bytes, limits.total_bytes,
                            options_.max_kept);
    return absl::OkStatus();
  }));
}

absl::StatusOr<std::string> PostgresUploadStore::Read(const BlobKey& key) {
  std::string bytes;
  const absl::Status read = pool_.Run([&](pqxx::work& transaction) {
    bytes.clear();
    const pqxx::result kept = transaction.exec_params(
        "SELECT bytes FROM isomatch.partial_uploads WHERE tenant = $1 "
        "AND sha256 = $2 AND kept_at > now() - $3::interval FOR SHARE",
        key.tenant, key.sha256, IntervalOf(options_.kept_for));
    if (kept.empty()) return absl::OkStatus();
    const int chunks = CountChunks(kept[0][0].as<std::int64_t>());
    bytes.reserve(kept[0][0].as<size_t>());
    for (int first = 0; first < chunks; first += kChunksAtOnce) {
      AppendChunks(transaction, kPartialChunks, key, first, bytes);
    }
    return absl::OkStatus();
  });
  ISOMATCH_RETURN_IF_ERROR(BlobStorageError(read));
  return bytes;
}

void PostgresUploadStore::Forget(const BlobKey& key) {
  (void)pool_.Ask(PostgresPool::Repeat::kOnce,
                  "DELETE FROM isomatch.partial_uploads "
                  "WHERE tenant = $1 AND sha256 = $2",
                  key.tenant, key.sha256);
}

absl::StatusOr<std::vector<std::size_t>> PostgresUploadStore::ReceivedBytes(
    const std::string& tenant, const std::vector<std::string>& sha256s) {
  const auto rows = pool_.Ask(
      PostgresPool::Repeat::kOnce,
      "SELECT sha256, bytes FROM isomatch.partial_uploads WHERE tenant = $1 "
      "AND sha256 = ANY ($2) AND kept_at > now() - $3::interval",
      tenant, ArrayOf(sha256s), IntervalOf(options_.kept_for));
  ISOMATCH_RETURN_IF_ERROR(BlobStorageError(rows.status()));
  std::map<std::string, std::size_t> kept;
  for (const pqxx::row& row : *rows) {
    kept[row[0].as<std::string>()] = row[1].as<std::size_t>();
  }
  std::vector<std::size_t> received;
  received.reserve(sha256s.size());
  for (const std::string& sha256 : sha256s) received.push_back(kept[sha256]);
  return received;
}

void PostgresUploadStore::Tidy() {
  (void)pool_.Ask(PostgresPool::Repeat::kOnce,
                  "DELETE FROM isomatch.partial_uploads "
                  "WHERE kept_at <= now() - $1::interval",
                  IntervalOf(options_.kept_for));
}

}  // namespace isomatch
