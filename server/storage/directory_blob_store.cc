#include "server/storage/directory_blob_store.h"

#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <list>
#include <new>
#include <system_error>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/storage/sha256.h"

namespace isomatch {
namespace {

namespace fs = std::filesystem;

/// Half-written files, which no tenant can be called.
constexpr char kTemporaryFolder[] = ".tmp";

/// How often a file is written that others remove before it is counted.
constexpr int kTries = 3;

struct FoundFile {
  BlobKey key;
  std::int64_t bytes = 0;
  fs::file_time_type written;
};

/// The blobs in the folder, oldest first. Whatever else is there is left alone.
absl::StatusOr<std::vector<FoundFile>> FilesIn(const std::string& folder) {
  std::vector<FoundFile> files;
  std::error_code error;
  fs::recursive_directory_iterator entry(folder, error);
  for (; !error && entry != fs::recursive_directory_iterator();
       entry.increment(error)) {
    const fs::path& path = entry->path();
    if (!entry->is_regular_file(error) ||
        !IsSha256Hex(path.filename().string())) {
      continue;
    }
    files.push_back(
        {{path.parent_path().parent_path().filename(), path.filename()},
         static_cast<std::int64_t>(entry->file_size(error)),
         entry->last_write_time(error)});
  }
  if (error) {
    return absl::UnavailableError(
        absl::StrCat("cannot read the folder ", folder, ": ", error.message()));
  }
  std::sort(files.begin(), files.end(), [](const auto& a, const auto& b) {
    return a.written != b.written ? a.written < b.written : a.key < b.key;
  });
  return files;
}

}  // namespace

absl::StatusOr<std::unique_ptr<DirectoryBlobStore>> DirectoryBlobStore::Open(
    const std::string& folder, std::int64_t capacity_bytes) {
  return Open(folder, capacity_bytes, Options());
}

absl::StatusOr<std::unique_ptr<DirectoryBlobStore>> DirectoryBlobStore::Open(
    const std::string& folder, std::int64_t capacity_bytes, Options options) {
  std::unique_ptr<DirectoryBlobStore> store(
      new DirectoryBlobStore(folder, capacity_bytes, std::move(options)));
  ISOMATCH_RETURN_IF_ERROR(store->Scan());
  return store;
}

DirectoryBlobStore::DirectoryBlobStore(const std::string& folder,
                                       std::int64_t capacity_bytes,
                                       Options options)
    : folder_(folder), options_(std::move(options)), index_(capacity_bytes) {}

absl::Status DirectoryBlobStore::Scan() {
  const std::string temporary = absl::StrCat(folder_, "/", kTemporaryFolder);
  std::error_code ignored;
  fs::remove_all(temporary, ignored);
  ISOMATCH_RETURN_IF_ERROR(MakeFolder(temporary));
  ISOMATCH_ASSIGN_OR_RETURN(std::vector<FoundFile> files, FilesIn(folder_));
  MutexLock lock(mutex_);
  for (FoundFile& file : files) {
    index_.Add({.key = std::move(file.key), .bytes = file.bytes});
  }
  return absl::OkStatus();
}

std::string DirectoryBlobStore::PathOf(const BlobKey& key) const {
  return absl::StrCat(folder_, "/", key.tenant, "/", key.sha256.substr(0, 2),
                      "/", key.sha256);
}

absl::Status DirectoryBlobStore::Put(const BlobKey& key, std::string bytes,
                                     Keep keep) {
  const int pins = keep == Keep::kPinned ? 1 : 0;
  auto size = static_cast<std::int64_t>(bytes.size());
  {
    MutexLock lock(mutex_);
    BlobIndex::Entry* entry = index_.Touch(key);
    if (entry != nullptr && !entry->is_damaged) {
      entry->pins += pins;
      return absl::OkStatus();
    }
    if (entry != nullptr) size = 0;  // it has its room
  }
  ISOMATCH_RETURN_IF_ERROR(TakeRoom(size));
  for (int tries = 0; tries < kTries; ++tries) {
    const absl::Status written = WriteWithinMemory(key, bytes);
    MutexLock lock(mutex_);
    arriving_bytes_ -= size;
    ISOMATCH_RETURN_IF_ERROR(written);
    if (AddWritten(key, bytes, pins)) return absl::OkStatus();
    arriving_bytes_ += size;
  }
  MutexLock lock(mutex_);
  arriving_bytes_ -= size;
  return absl::UnavailableError(
      absl::StrCat("the file ", PathOf(key), " vanishes"));
}

bool DirectoryBlobStore::AddWritten(const BlobKey& key,
                                    const std::string& bytes, int pins) {
  BlobIndex::Entry* entry = index_.Touch(key);  // somebody else may have put it
  if (entry == nullptr) {
    // Or put it and lost it again, and this file with it.
    if (access(PathOf(key).c_str(), F_OK) != 0) return false;
    entry = &index_.Add(
        {.key = key, .bytes = static_cast<std::int64_t>(bytes.size())});
  }
  entry->is_damaged = false;
  entry->pins += pins;
  return true;
}

absl::Status DirectoryBlobStore::TakeRoom(std::int64_t bytes) {
  MutexLock lock(mutex_);
  ISOMATCH_ASSIGN_OR_RETURN(const std::list<BlobIndex::Entry> evicted,
                            index_.MakeRoom(arriving_bytes_ + bytes));
  arriving_bytes_ += bytes;
  Unlink(evicted);
  return absl::OkStatus();
}

bool DirectoryBlobStore::MakeTenantRoom(const BlobKey& key, std::int64_t bytes,
                                        std::int64_t limit) {
  MutexLock lock(mutex_);
  const auto evicted = index_.MakeTenantRoom(key, bytes, limit);
  if (evicted.ok()) Unlink(*evicted);
  return evicted.ok();
}

void DirectoryBlobStore::Unlink(
    const std::list<BlobIndex::Entry>& evicted) const {
  for (const BlobIndex::Entry& entry : evicted) {
    unlink(PathOf(entry.key).c_str());
  }
}

absl::Status DirectoryBlobStore::WriteWithinMemory(const BlobKey& key,
                                                   const std::string& bytes) {
  try {
    return Write(key, bytes);
  } catch (const std::bad_alloc&) {
    return absl::ResourceExhaustedError("no memory to write it");
  }
}

absl::Status DirectoryBlobStore::Write(const BlobKey& key,
                                       const std::string& bytes) {
  const std::string path = PathOf(key);
  std::string temporary = absl::StrCat(folder_, "/", kTemporaryFolder, "/");
  {
    MutexLock lock(mutex_);
    absl::StrAppend(&temporary, ++last_temporary_);
  }
  ISOMATCH_RETURN_IF_ERROR(MakeFolder(fs::path(path).parent_path()));
  return options_.write(path, temporary, bytes);
}

bool DirectoryBlobStore::Pin(const BlobKey& key) {
  MutexLock lock(mutex_);
  return index_.ChangePins(key, 1);
}

void DirectoryBlobStore::Unpin(const BlobKey& key) {
  MutexLock lock(mutex_);
  (void)index_.ChangePins(key, -1);
}

BlobStore::Blob DirectoryBlobStore::Get(const BlobKey& key) {
  std::int64_t size = 0;
  {
    MutexLock lock(mutex_);
    const BlobIndex::Entry* entry = index_.Touch(key);
    if (entry == nullptr) return nullptr;
    if (Blob held = entry->held.lock()) return held;
    size = entry->bytes;
  }
  auto bytes = ReadWholeFile(PathOf(key), size);
  if (absl::IsUnavailable(bytes.status())) return nullptr;  // this time
  const bool intact =
      bytes.ok() && (!options_.are_digests || Sha256Hex(*bytes) == key.sha256);
  MutexLock lock(mutex_);
  BlobIndex::Entry* entry = index_.Touch(key);
  // If it was not just evicted: as good as not there until it is put again.
  if (entry != nullptr) entry->is_damaged = !intact;
  if (!intact) return nullptr;
  const Blob blob = std::make_shared<const std::string>(*std::move(bytes));
  if (entry != nullptr) entry->held = blob;
  return blob;
}

void DirectoryBlobStore::Remove(const BlobKey& key) {
  MutexLock lock(mutex_);
  const BlobIndex::Entry* entry = index_.Touch(key);
  if (entry == nullptr || entry->pins > 0) return;
  index_.Remove(key);
  unlink(PathOf(key).c_str());  // under the lock, as Unlink
}

bool DirectoryBlobStore::Has(const BlobKey& key) {
  MutexLock lock(mutex_);
  const BlobIndex::Entry* entry = index_.Touch(key);
  return entry != nullptr && !entry->is_damaged;
}

std::int64_t DirectoryBlobStore::size_bytes() const {
  MutexLock lock(mutex_);
  return index_.size_bytes() + arriving_bytes_;
}

}  // namespace isomatch
