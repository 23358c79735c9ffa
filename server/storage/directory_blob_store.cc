#include "server/storage/directory_blob_store.h"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <list>
#include <new>
#include <optional>
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

/// How often a file is written that others remove before it is counted, and
/// read that others write meanwhile.
constexpr int kTries = 3;

/// What is tried beyond the bytes asked for: folders and records take some,
/// too.
constexpr std::int64_t kTryMore = 64 << 10;

/// How long a blob that was read counts as whole without being read again.
constexpr auto kFresh = std::chrono::minutes(1);

struct FoundFile {
  BlobKey key;
  std::int64_t bytes = 0;
  fs::file_time_type written;
};

/// The file of a blob; nullopt for whatever else is there, which is left alone,
/// and for what cannot be looked at: it is found again when it is put again.
std::optional<FoundFile> Look(const fs::directory_entry& entry) {
  const fs::path& path = entry.path();
  std::error_code error;
  if (!IsSha256Hex(path.filename().string()) || !entry.is_regular_file(error)) {
    return std::nullopt;
  }
  const auto bytes = static_cast<std::int64_t>(entry.file_size(error));
  if (error) return std::nullopt;
  const fs::file_time_type written = entry.last_write_time(error);
  if (error) return std::nullopt;
  return FoundFile{
      {path.parent_path().parent_path().filename(), path.filename()},
      bytes,
      written};
}

/// Calls `visit` with what is in the folder; nothing when that cannot be read.
template <typename Visit>
void ForEachIn(const fs::path& folder, const Visit& visit) {
  std::error_code error;
  fs::directory_iterator entry(folder, error);
  while (!error && entry != fs::directory_iterator()) {
    visit(*entry);
    entry.increment(error);
  }
}

/// The blobs in the folder, oldest first.
absl::StatusOr<std::vector<FoundFile>> FilesIn(const std::string& folder) {
  std::error_code error;
  const fs::directory_iterator readable(folder, error);
  if (error) {
    return absl::UnavailableError(
        absl::StrCat("cannot read the folder ", folder, ": ", error.message()));
  }
  std::vector<FoundFile> files;
  ForEachIn(folder, [&](const fs::path& tenant) {
    ForEachIn(tenant, [&](const fs::path& digits) {
      ForEachIn(digits, [&](const fs::directory_entry& entry) {
        if (auto file = Look(entry)) files.push_back(*std::move(file));
      });
    });
  });
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
  if (PutAgain(key, bytes, pins)) return absl::OkStatus();
  auto size = static_cast<std::int64_t>(bytes.size());
  {
    MutexLock lock(mutex_);
    const BlobIndex::Entry* entry = index_.Touch(key);  // has some room
    if (entry != nullptr) size = std::max<std::int64_t>(0, size - entry->bytes);
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
    entry = &index_.Add({.key = key});
  }
  index_.Renew(*entry, static_cast<std::int64_t>(bytes.size()));
  entry->pins += pins;
  return true;
}

bool DirectoryBlobStore::PutAgain(const BlobKey& key, absl::string_view bytes,
                                  int pins) {
  std::uint64_t version = 0;
  {
    MutexLock lock(mutex_);
    BlobIndex::Entry* entry = index_.Touch(key);
    if (entry == nullptr || entry->is_damaged) return false;
    ++entry->pins;  // so that it stays meanwhile
    version = entry->version;
  }
  const absl::StatusOr<bool> same =
      options_.are_digests ? FileHolds(PathOf(key), bytes) : true;
  const bool is_damaged = same.ok() ? !*same : absl::IsNotFound(same.status());
  if (is_damaged) (void)SetDamaged(key, version);
  MutexLock lock(mutex_);
  BlobIndex::Entry* entry = index_.Touch(key);
  const bool is_put = entry != nullptr && !entry->is_damaged;
  (void)index_.ChangePins(key, is_put ? pins - 1 : -1);
  return is_put;
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
  ISOMATCH_RETURN_IF_ERROR(MakeFolderOf(key));
  return options_.write(path, temporary, bytes);
}

absl::Status DirectoryBlobStore::MakeFolderOf(const BlobKey& key) {
  const fs::path folder = fs::path(PathOf(key)).parent_path();
  ISOMATCH_RETURN_IF_ERROR(MakeFolder(folder));
  {
    MutexLock lock(mutex_);
    if (lasting_folders_.count(folder) != 0) return absl::OkStatus();
  }
  // Another thread may have made them, and not yet seen to it that they last.
  const fs::path tenant = folder.parent_path();
  ISOMATCH_RETURN_IF_ERROR(SyncFolder(tenant));
  ISOMATCH_RETURN_IF_ERROR(SyncFolder(tenant.parent_path()));
  MutexLock lock(mutex_);
  lasting_folders_.insert(folder);
  return absl::OkStatus();
}

bool DirectoryBlobStore::Pin(const BlobKey& key) {
  MutexLock lock(mutex_);
  return index_.ChangePins(key, 1);
}

void DirectoryBlobStore::Unpin(const BlobKey& key) {
  MutexLock lock(mutex_);
  (void)index_.ChangePins(key, -1);
}

std::optional<DirectoryBlobStore::Seen> DirectoryBlobStore::See(
    const BlobKey& key) const {
  MutexLock lock(mutex_);
  const BlobIndex::Entry* entry = index_.Touch(key);
  if (entry == nullptr) return std::nullopt;
  return Seen{entry->version, entry->bytes};
}

bool DirectoryBlobStore::SetDamaged(const BlobKey& key, std::uint64_t version) {
  MutexLock lock(mutex_);
  BlobIndex::Entry* entry = index_.Touch(key);
  if (entry == nullptr || entry->version != version) return false;
  entry->is_damaged = true;
  return true;
}

absl::StatusOr<BlobStore::Blob> DirectoryBlobStore::Get(const BlobKey& key) {
  for (int tries = 0; tries < kTries; ++tries) {
    absl::StatusOr<Blob> blob = Read(key);
    if (!absl::IsAborted(blob.status())) return blob;
  }
  return absl::UnavailableError(
      absl::StrCat("the file ", PathOf(key), " changes while it is read"));
}

absl::StatusOr<BlobStore::Blob> DirectoryBlobStore::Read(const BlobKey& key) {
  {
    MutexLock lock(mutex_);
    const BlobIndex::Entry* entry = index_.Touch(key);
    if (entry != nullptr) {
      if (Blob held = entry->held.lock()) return held;
    }
  }
  const std::optional<Seen> seen = See(key);
  if (!seen) return absl::NotFoundError(absl::StrCat("no ", PathOf(key)));
  auto bytes = options_.read(PathOf(key), seen->bytes);
  if (absl::IsUnavailable(bytes.status())) return bytes.status();
  const bool intact =
      bytes.ok() && (!options_.are_digests || Sha256Hex(*bytes) == key.sha256);
  if (!intact) {
    // If it was not just evicted: as good as not there until it is put again.
    if (SetDamaged(key, seen->version) || !See(key)) {
      return absl::NotFoundError(absl::StrCat(PathOf(key), " is damaged"));
    }
    return absl::AbortedError("put again meanwhile");
  }
  const Blob blob = std::make_shared<const std::string>(*std::move(bytes));
  MutexLock lock(mutex_);
  BlobIndex::Entry* entry = index_.Touch(key);
  if (entry != nullptr && entry->version == seen->version) {
    entry->is_damaged = false;
    entry->held = blob;
  }
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
  const std::optional<Seen> seen = See(key);
  if (!seen) return false;
  std::error_code error;
  const auto size = fs::file_size(PathOf(key), error);
  const bool is_gone = error == std::errc::no_such_file_or_directory ||
                       error == std::errc::not_a_directory;
  const bool is_other =
      !error && static_cast<std::int64_t>(size) != seen->bytes;
  if (is_gone || (is_other && options_.are_digests)) {
    (void)SetDamaged(key, seen->version);
  }
  MutexLock lock(mutex_);
  const BlobIndex::Entry* entry = index_.Touch(key);
  return entry != nullptr && !entry->is_damaged;
}

bool DirectoryBlobStore::HasWhole(const BlobKey& key) {
  const std::optional<Seen> seen = See(key);
  if (!seen || !options_.are_digests) return Has(key);
  const auto now = std::chrono::steady_clock::now();
  {
    MutexLock lock(mutex_);
    const BlobIndex::Entry* entry = index_.Touch(key);
    const bool is_fresh = entry != nullptr && now - entry->whole_at < kFresh;
    if (is_fresh) return !entry->is_damaged;
  }
  Sha256 sha256;
  const absl::Status read = ReadInPieces(PathOf(key), [&](auto piece) {
    sha256.Update(piece);
    return true;
  });
  if (absl::IsUnavailable(read)) return Has(key);
  if (!read.ok() || sha256.HexDigest() != key.sha256) {
    (void)SetDamaged(key, seen->version);
    return Has(key);
  }
  MutexLock lock(mutex_);
  BlobIndex::Entry* entry = index_.Touch(key);
  if (entry != nullptr) entry->whole_at = now;
  return entry != nullptr && !entry->is_damaged;
}

bool DirectoryBlobStore::CanMakeRoom(std::int64_t bytes) const {
  MutexLock lock(mutex_);
  return bytes <= index_.RoomBytes() - arriving_bytes_;
}

absl::Status DirectoryBlobStore::TryWriting(std::int64_t bytes) {
  const std::string path = absl::StrCat(folder_, "/", kTemporaryFolder, "/try");
  try {
    const std::string content(static_cast<size_t>(bytes + kTryMore), '\0');
    ISOMATCH_RETURN_IF_ERROR(MakeFolder(fs::path(path).parent_path()));
    ISOMATCH_RETURN_IF_ERROR(
        options_.write(path, absl::StrCat(path, ".new"), content));
  } catch (const std::bad_alloc&) {
    return absl::ResourceExhaustedError("no memory to write it");
  }
  unlink(path.c_str());
  return absl::OkStatus();
}

std::int64_t DirectoryBlobStore::size_bytes() const {
  MutexLock lock(mutex_);
  return index_.size_bytes() + arriving_bytes_;
}

}  // namespace isomatch
