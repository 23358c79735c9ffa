#include "server/storage/files.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <system_error>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"
#include "core/base/file_bytes.h"
#include "core/base/file_descriptor.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

/// What errno says of `path`.
absl::Status Refused(absl::string_view what, const std::string& path) {
  const int error = errno;
  const std::string message =
      absl::StrCat("cannot ", what, " ", path, ": ", std::strerror(error));
  const bool is_none =
      error == ENOENT || error == ENOTDIR || error == EISDIR || error == ELOOP;
  if (is_none) return absl::NotFoundError(message);
  if (error == ENOSPC || error == EDQUOT || error == EFBIG) {
    return absl::ResourceExhaustedError(message);
  }
  return absl::UnavailableError(message);
}

/// The same of reading, where a sector may be bad: trying again does not help.
absl::Status ReadRefused(const std::string& path) {
  const bool is_lost = errno == EIO || errno == EUCLEAN || errno == EBADMSG;
  const absl::Status refused = Refused("read", path);
  return is_lost ? absl::DataLossError(refused.message()) : refused;
}

absl::Status WriteAndSync(const std::string& path, absl::string_view bytes) {
  const auto file = FileDescriptor::Open(path, O_CREAT | O_WRONLY | O_TRUNC);
  if (!file.is_open()) return Refused("create", path);
  if (WriteAll(file.get(), bytes) != 0) return Refused("write", path);
  if (fsync(file.get()) != 0) return Refused("synchronize", path);
  return absl::OkStatus();
}

}  // namespace

absl::Status SyncFolder(const std::string& path) {
  const auto folder = FileDescriptor::Open(path, O_RDONLY | O_DIRECTORY);
  if (!folder.is_open()) return Refused("open", path);
  if (fsync(folder.get()) != 0) return Refused("synchronize", path);
  return absl::OkStatus();
}

absl::Status WriteFileDurably(const std::string& path,
                              const std::string& temporary,
                              absl::string_view bytes) {
  absl::Status status = WriteAndSync(temporary, bytes);
  if (status.ok() && rename(temporary.c_str(), path.c_str()) != 0) {
    status = Refused("rename", temporary);
  }
  if (!status.ok()) {
    unlink(temporary.c_str());
    return status;
  }
  return SyncFolder(std::filesystem::path(path).parent_path());
}

absl::StatusOr<std::string> ReadWholeFile(const std::string& path,
                                          std::int64_t max_bytes) {
  const auto file = FileDescriptor::Open(path, O_RDONLY);
  struct stat about = {};
  if (!file.is_open() || fstat(file.get(), &about) != 0) {
    return ReadRefused(path);
  }
  if (about.st_size > max_bytes) {
    return absl::DataLossError(absl::StrCat(
        path, " has ", about.st_size, " bytes, expected at most ", max_bytes));
  }
  // Fewer when it became shorter.
  std::string bytes;
  if (ReadUpTo(static_cast<size_t>(about.st_size), file.get(), &bytes) != 0) {
    return ReadRefused(path);
  }
  return bytes;
}

absl::Status ReadInPieces(const std::string& path,
                          const std::function<bool(absl::string_view)>& take) {
  constexpr size_t kPiece = size_t{64} << 10;
  const auto file = FileDescriptor::Open(path, O_RDONLY);
  if (!file.is_open()) return ReadRefused(path);
  std::string piece(kPiece, '\0');
  while (true) {
    const ssize_t got = read(file.get(), piece.data(), piece.size());
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return ReadRefused(path);
    if (got == 0) return absl::OkStatus();
    if (!take({piece.data(), static_cast<size_t>(got)})) {
      return absl::OkStatus();
    }
  }
}

absl::StatusOr<bool> FileHolds(const std::string& path,
                               absl::string_view bytes) {
  bool same = true;
  ISOMATCH_RETURN_IF_ERROR(ReadInPieces(path, [&](absl::string_view piece) {
    same = absl::ConsumePrefix(&bytes, piece);
    return same;
  }));
  return same && bytes.empty();
}

absl::StatusOr<FileAbout> AboutFile(const std::string& path) {
  struct stat about = {};
  if (stat(path.c_str(), &about) != 0) return Refused("look at", path);
  if (!S_ISREG(about.st_mode)) {
    return absl::NotFoundError(absl::StrCat(path, " is no file"));
  }
  return FileAbout{about.st_size};
}

absl::Status TryTakingRoom(const std::string& path, std::int64_t bytes) {
  const auto file = FileDescriptor::Open(path, O_CREAT | O_WRONLY | O_TRUNC);
  if (!file.is_open()) return Refused("create", path);
  errno = bytes > 0 ? posix_fallocate(file.get(), 0, bytes) : 0;
  absl::Status taken =
      errno == 0 ? absl::OkStatus() : Refused("take room for", path);
  unlink(path.c_str());
  return taken;
}

void RemoveFile(const std::string& path) { unlink(path.c_str()); }

void EmptyFolder(const std::string& path) {
  namespace fs = std::filesystem;
  std::error_code error;
  std::vector<fs::path> inside;
  for (fs::directory_iterator entry(path, error);
       !error && entry != fs::directory_iterator(); entry.increment(error)) {
    inside.push_back(entry->path());
  }
  for (const fs::path& each : inside) fs::remove_all(each, error);
}

absl::Status MakeFolder(const std::string& path) {
  namespace fs = std::filesystem;
  std::error_code error;
  std::vector<fs::path> made;
  for (fs::path folder = path;
       !folder.empty() && !fs::exists(folder, error) && !error;
       folder = folder.parent_path()) {
    made.push_back(folder);
  }
  if (!error) fs::create_directories(path, error);
  if (error) {
    return absl::UnavailableError(
        absl::StrCat("cannot make the folder ", path, ": ", error.message()));
  }
  // From the outside in, so that none is lost with the power.
  for (auto folder = made.rbegin(); folder != made.rend(); ++folder) {
    const fs::path outer = folder->parent_path();
    ISOMATCH_RETURN_IF_ERROR(SyncFolder(outer.empty() ? "." : outer.string()));
  }
  return absl::OkStatus();
}

absl::StatusOr<FolderLock> FolderLock::Take(const std::string& folder) {
  const std::string path = absl::StrCat(folder, "/lock");
  FileDescriptor file = FileDescriptor::Open(path, O_CREAT | O_RDWR);
  if (!file.is_open()) return Refused("open", path);
  if (flock(file.get(), LOCK_EX | LOCK_NB) != 0) {
    return absl::FailedPreconditionError(absl::StrCat(
        folder,
        " is in use by another isomatch-server; expected a folder of "
        "its own for each"));
  }
  return FolderLock(std::move(file));
}

}  // namespace isomatch
