#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "core/base/file_descriptor.h"

namespace isomatch {

/// Writes a file whole or not at all, also when the machine loses power: into
/// `temporary` (same file system), synchronized, renamed to `path`, the folder
/// synchronized. Readable by its owner only. RESOURCE_EXHAUSTED: the disk is
/// full; UNAVAILABLE: it refuses for another reason. Nothing is left then,
/// unless only the last step failed.
absl::Status WriteFileDurably(const std::string& path,
                              const std::string& temporary,
                              absl::string_view bytes);

/// Returns what the file holds. NOT_FOUND, also for what is no file;
/// UNAVAILABLE when it cannot be read, as without a free file descriptor;
/// DATA_LOSS when it has more than `max_bytes`, or lies on a bad sector.
absl::StatusOr<std::string> ReadWholeFile(const std::string& path,
                                          std::int64_t max_bytes);

/// Gives `take` what the file holds, piece by piece, until it returns false.
/// NOT_FOUND; UNAVAILABLE when it cannot be read; DATA_LOSS for a bad sector.
absl::Status ReadInPieces(const std::string& path,
                          const std::function<bool(absl::string_view)>& take);

/// Whether the file holds these bytes. Errors as ReadInPieces.
absl::StatusOr<bool> FileHolds(const std::string& path,
                               absl::string_view bytes);

struct FileAbout {
  std::int64_t bytes = 0;
};

/// Looks at the file without opening it. NOT_FOUND, also for what is no file;
/// UNAVAILABLE when the system does not tell.
absl::StatusOr<FileAbout> AboutFile(const std::string& path);

/// Whether the disk has room for a file of so many bytes; there is none at
/// `path` afterward. Nothing is written where the file system can do without.
/// Errors as WriteFileDurably.
absl::Status TryTakingRoom(const std::string& path, std::int64_t bytes);

/// Removes the file, if it is there and can be.
void RemoveFile(const std::string& path);

/// Removes what is in the folder, as far as possible; it stays itself, so that
/// a full disk need not make it again.
void EmptyFolder(const std::string& path);

/// What was made or renamed in the folder survives the loss of power.
absl::Status SyncFolder(const std::string& path);

/// Makes the folder and those above it; nothing when it is there. UNAVAILABLE
/// names the folder and the system's reason.
absl::Status MakeFolder(const std::string& path);

/// Keeps other processes from using a folder as long as it lives.
class FolderLock {
 public:
  /// FAILED_PRECONDITION when another process has the lock.
  static absl::StatusOr<FolderLock> Take(const std::string& folder);

 private:
  explicit FolderLock(FileDescriptor file) : file_(std::move(file)) {}

  FileDescriptor file_;
};

}  // namespace isomatch
