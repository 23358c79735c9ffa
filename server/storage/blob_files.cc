#include "server/storage/blob_files.h"

#include <algorithm>
#include <set>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/sha256.h"

namespace isomatch {
namespace {

namespace fs = std::filesystem;

class BlobFiles {
 public:
  using OnUnreadable =
      std::function<void(const std::string& folder, const std::string& why)>;
  explicit BlobFiles(const OnUnreadable& on_unreadable)
      : on_unreadable_(on_unreadable) {}

  absl::StatusOr<std::vector<FoundBlob>> Find(const std::string& folder) {
    std::error_code error;
    const fs::directory_iterator readable(folder, error);
    if (error) {
      return absl::UnavailableError(absl::StrCat(
          "cannot read the folder ", folder, ": ", error.message()));
    }
    ForEachIn(folder, [&](const fs::path& tenant) {
      ForEachIn(tenant, [&](const fs::path& digits) {
        ForEachIn(digits,
                  [&](const fs::directory_entry& entry) { Look(entry); });
      });
    });
    std::sort(files_.begin(), files_.end(), [](const auto& a, const auto& b) {
      return a.written != b.written ? a.written < b.written : a.key < b.key;
    });
    return std::move(files_);
  }

 private:
  /// Adds the file of a blob; whatever else is there is left alone.
  void Look(const fs::directory_entry& entry) {
    const fs::path& path = entry.path();
    if (!IsSha256Hex(path.filename().string())) return;
    std::error_code error;
    if (!entry.is_regular_file(error)) return Tell(path.parent_path(), error);
    const auto bytes = static_cast<std::int64_t>(entry.file_size(error));
    if (error) return Tell(path.parent_path(), error);
    const fs::file_time_type written = entry.last_write_time(error);
    if (error) return Tell(path.parent_path(), error);
    files_.push_back(
        {{path.parent_path().parent_path().filename(), path.filename()},
         bytes,
         written});
  }

  /// Calls `visit` with what is in the folder; nothing when that cannot be
  /// read.
  template <typename Visit>
  void ForEachIn(const fs::path& folder, const Visit& visit) {
    std::error_code error;
    fs::directory_iterator entry(folder, error);
    while (!error && entry != fs::directory_iterator()) {
      visit(*entry);
      entry.increment(error);
    }
    Tell(folder, error);
  }

  /// Once of each folder.
  void Tell(const fs::path& folder, const std::error_code& error) {
    const bool is_none = !error ||
                         error == std::errc::no_such_file_or_directory ||
                         error == std::errc::not_a_directory;
    if (is_none || !told_.insert(folder).second) return;
    on_unreadable_(folder, error.message());
  }

  const OnUnreadable& on_unreadable_;
  std::vector<FoundBlob> files_;
  std::set<fs::path> told_;
};

}  // namespace

absl::StatusOr<std::vector<FoundBlob>> FindBlobs(
    const std::string& folder, const OnUnreadable& on_unreadable) {
  return BlobFiles(on_unreadable).Find(folder);
}

}  // namespace isomatch
