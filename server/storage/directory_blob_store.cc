#include "server/storage/directory_blob_store.h"

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <iterator>
#include <list>
#include <new>
#include <optional>
#include <system_error>
#include <utility>
#include <vector>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/str_cat.h"
#include "core/base/sha256.h"
#include "core/base/status_macros.h"
#include "server/storage/blob_files.h"

namespace isomatch {
namespace {

namespace fs = std::filesystem;

/// Half-written files, which no tenant can be called.
constexpr char kTemporaryFolder[] = ".tmp";

/// How often a file is read that others write meanwhile.
constexpr int kTries = 3;

/// What is tried first, and beyond the bytes asked for: folders and records
/// take some, too.
constexpr std::int64_t kTryMore = 64 << 10;

/// How long a blob that was read counts as whole without being read again.
constexpr auto kFresh = std::chrono::minutes(1);

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

void DirectoryBlobStore::Tidy(const std::string& folder) {
  EmptyFolder(absl::StrCat(folder, "/", kTemporaryFolder));
}

absl::Status DirectoryBlobStore::Scan() {
  Tidy(folder_);
  ISOMATCH_RETURN_IF_ERROR(
      MakeFolder(absl::StrCat(folder_, "/", kTemporaryFolder)));
  ISOMATCH_ASSIGN_OR_RETURN(std::vector<FoundBlob> files,
                            FindBlobs(folder_, options_.on_unreadable));
  MutexLock lock(mutex_);
  for (FoundBlob& file : files) {
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
  ISOMATCH_RETURN_IF_ERROR(TakeRoom(key, size));
  return WriteAndAdd(key, bytes, size, pins);
}

absl::Status DirectoryBlobStore::WriteAndAdd(const BlobKey& key,
                                             const std::string& bytes,
                                             std::int64_t reserved, int pins) {
  const absl::Status written = WriteWithinMemory(key, bytes);
  MutexLock lock(mutex_);
  arriving_bytes_ -= reserved;
  EndUse(key);
  ISOMATCH_RETURN_IF_ERROR(written);
  BlobIndex::Entry* entry = index_.Touch(key);  // somebody else may have put it
  if (entry == nullptr) entry = &index_.Add({.key = key});
  index_.Renew(*entry, static_cast<std::int64_t>(bytes.size()));
  entry->pins += pins;
  return absl::OkStatus();
}

bool DirectoryBlobStore::PutAgain(const BlobKey& key, const std::string& bytes,
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
  // What cannot be read just now is either healed or left as it is.
  const bool is_unknown = absl::IsUnavailable(same.status());
  const bool is_rewritten = is_unknown && WriteWithinMemory(key, bytes).ok();
  const bool is_damaged = same.ok() ? !*same : !is_unknown;
  if (is_damaged) (void)SetDamaged(key, version);
  MutexLock lock(mutex_);
  BlobIndex::Entry* entry = index_.Touch(key);
  if (is_rewritten && entry != nullptr) {
    index_.Renew(*entry, static_cast<std::int64_t>(bytes.size()));
  }
  const bool is_put = entry != nullptr && !entry->is_damaged;
  (void)index_.ChangePins(key, is_put ? pins - 1 : -1);
  return is_put;
}

absl::Status DirectoryBlobStore::TakeRoom(const BlobKey& key,
                                          std::int64_t bytes) {
  std::list<BlobIndex::Entry> evicted;
  {
    MutexLock lock(mutex_);
    BeginUse(key);
    auto unused = absl::MakeCleanup(
        [&]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) { EndUse(key); });
    ISOMATCH_ASSIGN_OR_RETURN(evicted,
                              index_.MakeRoom(arriving_bytes_ + bytes));
    arriving_bytes_ += bytes;
    BeginUnlink(evicted);
    std::move(unused).Cancel();
  }
  Unlink(evicted);
  return absl::OkStatus();
}

bool DirectoryBlobStore::MakeTenantRoom(const BlobKey& key, std::int64_t bytes,
                                        std::int64_t limit) {
  absl::StatusOr<std::list<BlobIndex::Entry>> evicted;
  {
    MutexLock lock(mutex_);
    evicted = index_.MakeTenantRoom(key, bytes, limit);
    if (evicted.ok()) BeginUnlink(*evicted);
  }
  if (evicted.ok()) Unlink(*evicted);
  return evicted.ok();
}

void DirectoryBlobStore::BeginUnlink(std::list<BlobIndex::Entry>& evicted) {
  for (auto entry = evicted.begin(); entry != evicted.end();) {
    bool stays = in_use_.count(entry->key) != 0;
    try {
      if (!stays) leaving_.insert(entry->key);
    } catch (const std::bad_alloc&) {
      stays = true;  // and is found when it is asked for
    }
    entry = stays ? evicted.erase(entry) : std::next(entry);
  }
}

void DirectoryBlobStore::Unlink(const std::list<BlobIndex::Entry>& leaving) {
  for (const BlobIndex::Entry& entry : leaving) {
    try {
      options_.remove(PathOf(entry.key));
    } catch (const std::bad_alloc&) {  // as above
    }
  }
  if (leaving.empty()) return;
  MutexLock lock(mutex_);
  for (const BlobIndex::Entry& entry : leaving) leaving_.erase(entry.key);
  left_.NotifyAll();
}

void DirectoryBlobStore::BeginUse(const BlobKey& key) {
  while (leaving_.count(key) != 0) left_.Wait(mutex_);
  in_use_.insert(key);
}

void DirectoryBlobStore::EndUse(const BlobKey& key) {
  in_use_.erase(in_use_.find(key));
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
  ISOMATCH_RETURN_IF_ERROR(MakeFolderOf(key));
  return options_.write(PathOf(key), TemporaryPath(), bytes);
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
  if (!FindFile(key).ok()) return false;
  MutexLock lock(mutex_);
  return index_.ChangePins(key, 1);
}

void DirectoryBlobStore::PinWhenThere(const BlobKey& key) {
  if (Pin(key)) return;
  MutexLock lock(mutex_);
  if (index_.ChangePins(key, 1)) return;
  index_.Add({.key = key, .pins = 1, .is_damaged = true, .is_awaited = true});
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

absl::Status DirectoryBlobStore::FindFile(const BlobKey& key) {
  if (!IsSha256Hex(key.sha256)) return absl::NotFoundError(key.sha256);
  {
    MutexLock lock(mutex_);
    const BlobIndex::Entry* entry = index_.Touch(key);
    if (entry != nullptr && !entry->is_awaited) return absl::OkStatus();
    BeginUse(key);
  }
  absl::StatusOr<FileAbout> about;
  try {
    about = options_.look(PathOf(key));
  } catch (const std::bad_alloc&) {
    about = absl::UnavailableError("no memory to look for it");
  }
  MutexLock lock(mutex_);
  EndUse(key);
  BlobIndex::Entry* entry = index_.Touch(key);
  if (entry != nullptr && !entry->is_awaited) return absl::OkStatus();
  ISOMATCH_RETURN_IF_ERROR(about.status());
  if (entry == nullptr) entry = &index_.Add({.key = key});
  index_.Renew(*entry, about->bytes);
  return absl::OkStatus();
}

absl::StatusOr<DirectoryBlobStore::Seen> DirectoryBlobStore::Find(
    const BlobKey& key) {
  ISOMATCH_RETURN_IF_ERROR(FindFile(key));
  const std::optional<Seen> seen = See(key);
  if (!seen) return absl::NotFoundError(absl::StrCat("no ", PathOf(key)));
  return *seen;
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
  ISOMATCH_ASSIGN_OR_RETURN(const Seen seen, Find(key));
  auto bytes = options_.read(PathOf(key), seen.bytes);
  if (absl::IsUnavailable(bytes.status())) return bytes.status();
  const bool intact =
      bytes.ok() && (!options_.are_digests || Sha256Hex(*bytes) == key.sha256);
  if (!intact) {
    // If it was not just evicted: as good as not there until it is put again.
    if (SetDamaged(key, seen.version) || !See(key)) {
      return absl::NotFoundError(absl::StrCat(PathOf(key), " is damaged"));
    }
    return absl::AbortedError("put again meanwhile");
  }
  const Blob blob = std::make_shared<const std::string>(*std::move(bytes));
  MutexLock lock(mutex_);
  BlobIndex::Entry* entry = index_.Touch(key);
  if (entry != nullptr && entry->version == seen.version) {
    entry->is_damaged = false;
    entry->held = blob;
  }
  return blob;
}

void DirectoryBlobStore::Remove(const BlobKey& key) {
  (void)FindFile(key);
  std::list<BlobIndex::Entry> removed;
  removed.push_back({.key = key});
  {
    MutexLock lock(mutex_);
    const BlobIndex::Entry* entry = index_.Touch(key);
    if (entry == nullptr || entry->pins > 0) return;
    index_.Remove(key);
    BeginUnlink(removed);
  }
  Unlink(removed);
}

bool DirectoryBlobStore::Has(const BlobKey& key) {
  const absl::StatusOr<Seen> seen = Find(key);
  if (!seen.ok()) return false;
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
  const absl::StatusOr<Seen> seen = Find(key);
  if (!seen.ok() || !options_.are_digests) return Has(key);
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

std::string DirectoryBlobStore::TemporaryPath() {
  MutexLock lock(mutex_);
  return absl::StrCat(folder_, "/", kTemporaryFolder, "/", ++last_temporary_);
}

absl::Status DirectoryBlobStore::TryWriting(std::int64_t bytes) {
  try {
    const std::string path = TemporaryPath();
    const std::string content(static_cast<size_t>(kTryMore), '\0');
    ISOMATCH_RETURN_IF_ERROR(MakeFolder(fs::path(path).parent_path()));
    ISOMATCH_RETURN_IF_ERROR(
        options_.write(path, absl::StrCat(path, ".new"), content));
    RemoveFile(path);
    return TryTakingRoom(path, bytes + kTryMore);
  } catch (const std::bad_alloc&) {
    return absl::ResourceExhaustedError("no memory to write it");
  }
}

std::int64_t DirectoryBlobStore::size_bytes() const {
  MutexLock lock(mutex_);
  return index_.size_bytes() + arriving_bytes_;
}

}  // namespace isomatch
