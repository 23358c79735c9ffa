#pragma once

#include <cstdint>
#include <string>

#include <pqxx/pqxx>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/storage/blob_store.h"

namespace isomatch {

/// Where a row of isomatch.blobs says that its content is.
struct BlobPlace {
  std::int64_t bytes = 0;
  /// Rows of isomatch.blob_chunks; 0 when it is in a file.
  int chunks = 0;
  /// Below the folder of files; empty when it is in rows.
  std::string file = "";
};

/// The content of blobs, whose rows are written by others. Statuses are those
/// of BlobStore::Put, and DATA_LOSS. Thread-safe.
class BlobContent {
 public:
  virtual ~BlobContent() = default;

  /// Writes what has to be there before the row is, and returns where. Errors
  /// as BlobStore::Put.
  virtual absl::StatusOr<BlobPlace> Write(const BlobKey& key,
                                          const std::string& bytes) = 0;

  /// Writes the rest, with the row. Throws what libpqxx throws.
  virtual void Insert(pqxx::work& transaction, const BlobKey& key,
                      const std::string& bytes) = 0;

  /// Takes back what Write has written: no row needs it.
  virtual void TakeBack(const BlobPlace& place) = 0;

  /// Returns what is there, unchecked. DATA_LOSS: it is not, or damaged;
  /// UNAVAILABLE: it cannot be read just now.
  virtual absl::StatusOr<std::string> Read(const BlobKey& key,
                                           const BlobPlace& place) = 0;

  /// Removes what rows needed that are gone.
  virtual void RemoveDropped() = 0;

  /// Removes what processes have left that ended before they had their rows.
  virtual void Tidy() = 0;

  /// Errors as BlobStore::TryWriting.
  virtual absl::Status TryWriting(std::int64_t bytes) = 0;
};

/// What a BlobStore may say of an error of the database.
absl::Status BlobStorageError(const absl::Status& status);

}  // namespace isomatch
