#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/storage/blob_store.h"

namespace isomatch {

/// Files of a folder that several processes and machines share. Each is written
/// once, under a name that no other ever has, so that whoever removes it cannot
/// hit another one's. Errors are those of server/storage/files.h. Thread-safe.
class SharedFolder {
 public:
  explicit SharedFolder(std::string folder) : folder_(std::move(folder)) {}

  const std::string& path() const { return folder_; }

  /// Returns what the folder's file `isomatch-blobs` says it belongs to; empty
  /// when there is none, as when nothing is mounted. NOT_FOUND: no folder.
  absl::StatusOr<std::string> ReadMark() const;
  absl::Status Mark(const std::string& mark) const;

  /// Returns TENANT/AB/SHA256.RANDOM.
  static std::string NewName(const BlobKey& key);

  /// Writes NAME.new, and renames it: whole or not at all, also when the
  /// machine loses power.
  absl::Status Write(const std::string& name, const std::string& bytes) const;

  absl::StatusOr<std::string> Read(const std::string& name,
                                   std::int64_t max_bytes) const;

  /// Removes the file, if it is there and can be.
  void Remove(const std::string& name) const;

  /// Returns the files, also unfinished ones, that were written so long ago, as
  /// far as they can be read. Lists the whole folder.
  std::vector<std::string> OlderThan(std::chrono::seconds age) const;

  /// Whether there is room for so many bytes.
  absl::Status TryWriting(std::int64_t bytes) const;

 private:
  std::string PathOf(const std::string& name) const;

  const std::string folder_;
};

}  // namespace isomatch
