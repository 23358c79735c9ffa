#include "server/storage/shared_folder.h"

#include <sys/random.h>

#include <array>
#include <filesystem>
#include <system_error>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "core/base/sha256.h"
#include "core/base/status_macros.h"
#include "server/storage/files.h"

namespace isomatch {
namespace {

namespace fs = std::filesystem;

constexpr char kMarkFile[] = "isomatch-blobs";
constexpr char kUnfinished[] = ".new";
constexpr std::int64_t kMostMarkBytes = 4096;

/// Returns hexadecimal digits that nobody else gets.
std::string RandomDigits() {
  std::array<char, 8> bytes = {};
  (void)getrandom(bytes.data(), bytes.size(), 0);
  return absl::BytesToHexString({bytes.data(), bytes.size()});
}

/// Whether `name` is SHA256.RANDOM, or that with ".new".
bool IsBlobFile(absl::string_view name) {
  const size_t end = name.find('.');
  return end != absl::string_view::npos &&
         IsSha256Hex(std::string(name.substr(0, end)));
}

/// Calls `visit` with what is in a folder, as far as it can be read.
template <typename Visit>
void ForEachIn(const fs::path& folder, const Visit& visit) {
  std::error_code error;
  for (fs::directory_iterator entry(folder, error);
       !error && entry != fs::directory_iterator(); entry.increment(error)) {
    visit(*entry);
  }
}

/// Makes a folder of files below `root`, which survives the loss of power.
absl::Status MakeFolderBelow(const fs::path& root, const fs::path& folder) {
  std::error_code error;
  if (fs::exists(folder, error)) return absl::OkStatus();
  ISOMATCH_RETURN_IF_ERROR(MakeFolder(folder.string()));
  ISOMATCH_RETURN_IF_ERROR(SyncFolder(folder.parent_path().string()));
  return SyncFolder(root.string());
}

}  // namespace

std::string SharedFolder::PathOf(const std::string& name) const {
  return absl::StrCat(folder_, "/", name);
}

absl::StatusOr<std::string> SharedFolder::ReadMark() const {
  auto mark = ReadWholeFile(PathOf(kMarkFile), kMostMarkBytes);
  if (!absl::IsNotFound(mark.status())) return mark;
  std::error_code unknown;
  if (!fs::is_directory(folder_, unknown)) {
    return absl::NotFoundError("no such folder, expected one that exists");
  }
  return "";
}

absl::Status SharedFolder::Mark(const std::string& mark) const {
  return WriteFileDurably(PathOf(kMarkFile),
                          PathOf(absl::StrCat(kMarkFile, ".", RandomDigits())),
                          mark);
}

std::string SharedFolder::NewName(const BlobKey& key) {
  return absl::StrCat(key.tenant, "/", key.sha256.substr(0, 2), "/", key.sha256,
                      ".", RandomDigits());
}

absl::Status SharedFolder::Write(const std::string& name,
                                 const std::string& bytes) const {
  const std::string path = PathOf(name);
  ISOMATCH_RETURN_IF_ERROR(
      MakeFolderBelow(folder_, fs::path(path).parent_path()));
  absl::Status written =
      WriteFileDurably(path, absl::StrCat(path, kUnfinished), bytes);
  if (!written.ok()) RemoveFile(path);
  return written;
}

absl::StatusOr<std::string> SharedFolder::Read(const std::string& name,
                                               std::int64_t max_bytes) const {
  return ReadWholeFile(PathOf(name), max_bytes);
}

void SharedFolder::Remove(const std::string& name) const {
  RemoveFile(PathOf(name));
}

std::vector<std::string> SharedFolder::OlderThan(
    std::chrono::seconds age) const {
  std::vector<std::string> files;
  // By the clock that gives files their times, which may be another machine's.
  const std::string probe = PathOf(absl::StrCat("now.", RandomDigits()));
  std::error_code error;
  if (!WriteFileDurably(probe, probe + kUnfinished, "").ok()) return files;
  const fs::file_time_type now = fs::last_write_time(probe, error);
  RemoveFile(probe);
  if (error) return files;
  const auto look = [&](const fs::directory_entry& entry) {
    if (!IsBlobFile(entry.path().filename().string())) return;
    std::error_code unknown;
    const fs::file_time_type written = entry.last_write_time(unknown);
    if (unknown || written >= now - age) return;
    files.push_back(entry.path().lexically_relative(folder_).string());
  };
  ForEachIn(folder_, [&](const fs::path& tenant) {
    ForEachIn(tenant, [&](const fs::path& digits) { ForEachIn(digits, look); });
  });
  return files;
}

absl::Status SharedFolder::TryWriting(std::int64_t bytes) const {
  return TryTakingRoom(PathOf(absl::StrCat("try.", RandomDigits())), bytes);
}

}  // namespace isomatch
