#include "server/postgres/blob_folder.h"

#include <algorithm>
#include <chrono>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/postgres/job_rows.h"

namespace isomatch {
namespace {

using Repeat = PostgresPool::Repeat;

/// Dropped files that one transaction removes.
constexpr int kUnlinkedAtOnce = 100;
/// Files without a row that one statement looks for.
constexpr size_t kLookedForAtOnce = 500;
/// How old they must be, and how often they are looked for: the whole folder is
/// listed.
constexpr std::chrono::hours kOrphanAge{24};
constexpr std::chrono::hours kSearchInterval{1};

/// An error of the folder itself, which names its flag.
absl::Status FolderError(const absl::Status& status,
                         const SharedFolder& folder) {
  if (status.ok()) return status;
  return BlobStorageError(
      {status.code(),
       absl::StrCat("--blob-dir = ", folder.path(), ": ", status.message())});
}

}  // namespace

absl::Status BlobFolder::Check() {
  std::string known;
  {
    MutexLock lock(mutex_);
    known = mark_;
  }
  std::string mark = known;
  bool is_marked = true;
  if (mark.empty()) {
    const auto rows = pool_.Ask(
        Repeat::kOnce, "SELECT mark, is_marked FROM isomatch.blob_folder");
    ISOMATCH_RETURN_IF_ERROR(BlobStorageError(rows.status()));
    mark = rows->front()[0].as<std::string>();
    is_marked = rows->front()[1].as<bool>();
  }
  const absl::StatusOr<std::string> found = folder_.ReadMark();
  ISOMATCH_RETURN_IF_ERROR(FolderError(found.status(), folder_));
  const bool is_new = found->empty() && !is_marked;
  if (!is_new && *found != mark) {
    return absl::UnavailableError(
        absl::StrCat("--blob-dir = ", folder_.path(),
                     " is not the folder of this database: its file "
                     "isomatch-blobs does not say ",
                     mark));
  }
  if (!known.empty()) return absl::OkStatus();
  if (is_new) {
    ISOMATCH_RETURN_IF_ERROR(FolderError(folder_.Mark(mark), folder_));
  }
  const auto marked = pool_.Ask(
      Repeat::kOnce, "UPDATE isomatch.blob_folder SET is_marked = true");
  ISOMATCH_RETURN_IF_ERROR(BlobStorageError(marked.status()));
  MutexLock lock(mutex_);
  mark_ = mark;
  return absl::OkStatus();
}

absl::StatusOr<BlobPlace> BlobFolder::Write(const BlobKey& key,
                                            const std::string& bytes) {
  ISOMATCH_RETURN_IF_ERROR(Check());
  BlobPlace place = {.bytes = static_cast<std::int64_t>(bytes.size()),
                     .file = SharedFolder::NewName(key)};
  absl::Status written = folder_.Write(place.file, bytes);
  if (absl::IsResourceExhausted(written)) {
    RemoveDropped();
    written = folder_.Write(place.file, bytes);
  }
  ISOMATCH_RETURN_IF_ERROR(BlobStorageError(written));
  return place;
}

void BlobFolder::TakeBack(const BlobPlace& place) {
  folder_.Remove(place.file);
}

absl::StatusOr<std::string> BlobFolder::Read(const BlobKey& /*key*/,
                                             const BlobPlace& place) {
  auto bytes = folder_.Read(place.file, place.bytes);
  const bool is_lost =
      absl::IsNotFound(bytes.status()) || absl::IsDataLoss(bytes.status());
  if (!is_lost) {
    ISOMATCH_RETURN_IF_ERROR(BlobStorageError(bytes.status()));
    return bytes;
  }
  ISOMATCH_RETURN_IF_ERROR(Check());  // or all of them are away
  return absl::DataLossError(bytes.status().message());
}

void BlobFolder::RemoveDropped() {
  size_t removed = kUnlinkedAtOnce;
  const auto remove = [&](pqxx::work& transaction) {
    const pqxx::result files = transaction.exec_params(
        "SELECT file FROM isomatch.dropped_files "
        "FOR UPDATE SKIP LOCKED LIMIT $1",
        kUnlinkedAtOnce);
    removed = static_cast<size_t>(files.size());
    std::vector<std::string> names;
    for (const pqxx::row& row : files) {
      names.push_back(row[0].as<std::string>());
      folder_.Remove(names.back());
    }
    if (names.empty()) return absl::OkStatus();
    transaction.exec_params(
        "DELETE FROM isomatch.dropped_files WHERE file = ANY ($1::text[])",
        ArrayOf(names));
    return absl::OkStatus();
  };
  while (removed == kUnlinkedAtOnce) {
    if (!Check().ok() || !pool_.Run(remove).ok()) return;
  }
}

void BlobFolder::RemoveUnknown(const std::vector<std::string>& files) {
  const auto unknown =
      pool_.Ask(Repeat::kOnce,
                "SELECT f FROM unnest($1::text[]) f WHERE NOT EXISTS "
                "(SELECT FROM isomatch.blobs b WHERE b.file = f)",
                ArrayOf(files));
  if (!unknown.ok()) return;
  for (const pqxx::row& row : *unknown) {
    folder_.Remove(row[0].as<std::string>());
  }
}

void BlobFolder::Tidy() {
  RemoveDropped();
  {
    MutexLock lock(mutex_);
    const auto now = std::chrono::steady_clock::now();
    if (now < next_search_) return;
    next_search_ = now + kSearchInterval;
  }
  if (!Check().ok()) return;
  const std::vector<std::string> old = folder_.OlderThan(kOrphanAge);
  for (size_t first = 0; first < old.size(); first += kLookedForAtOnce) {
    const auto begin = old.begin() + static_cast<std::ptrdiff_t>(first);
    const size_t count = std::min(kLookedForAtOnce, old.size() - first);
    RemoveUnknown({begin, begin + static_cast<std::ptrdiff_t>(count)});
  }
}

absl::Status BlobFolder::TryWriting(std::int64_t bytes) {
  ISOMATCH_RETURN_IF_ERROR(Check());
  return BlobStorageError(folder_.TryWriting(bytes));
}

}  // namespace isomatch
