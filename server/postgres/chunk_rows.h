#pragma once

#include <cstdint>
#include <string>

#include <pqxx/pqxx>

#include "absl/strings/string_view.h"
#include "server/storage/blob_store.h"

namespace isomatch {

/// Tables with columns tenant, sha256, index and content: bytes in rows of
/// kChunkBytes each, but for the last one, which are written once.
inline constexpr std::int64_t kChunkBytes = 256 * 1024;

/// Rows that one statement writes or reads: 4 MiB, so that it ends in time, and
/// neither side needs memory for much more than the bytes.
inline constexpr int kChunksAtOnce = 16;

/// Returns how many rows so many bytes need.
int CountChunks(std::int64_t bytes);

/// Inserts the rows of a key, but for those of its first `begin` bytes, which
/// are whole rows. Throws what libpqxx throws.
void InsertChunks(pqxx::work& transaction, const char* table,
                  const BlobKey& key, absl::string_view bytes,
                  std::size_t begin = 0);

/// Appends the content of the rows from number `first` on, kChunksAtOnce of
/// them at most, that are there. Throws what libpqxx throws.
void AppendChunks(pqxx::transaction_base& transaction, const char* table,
                  const BlobKey& key, int first, std::string& bytes);

}  // namespace isomatch
