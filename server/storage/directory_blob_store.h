#pragma once

#include <cstdint>
#include <functional>
#include <list>
#include <memory>
#include <optional>
#include <set>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "core/base/mutex.h"
#include "server/storage/blob_files.h"
#include "server/storage/blob_index.h"
#include "server/storage/blob_store.h"
#include "server/storage/files.h"

namespace isomatch {

/// Blobs in files FOLDER/TENANT/AB/SHA256, where AB are the digest's first two
/// digits; never more than `capacity_bytes` of content. What Put accepted
/// survives a crash and the loss of power. A file whose content is not what its
/// name says is treated as missing, and written again when it is put again.
/// Thread-safe; one store for each folder.
class DirectoryBlobStore : public BlobStore {
 public:
  struct Options {
    /// As WriteFileDurably; tests make it fail.
    std::function<absl::Status(const std::string& path,
                               const std::string& temporary,
                               absl::string_view bytes)>
        write = WriteFileDurably;
    /// As ReadWholeFile; tests make it fail.
    std::function<absl::StatusOr<std::string>(const std::string& path,
                                              std::int64_t max_bytes)>
        read = ReadWholeFile;
    /// As AboutFile; tests make it fail.
    std::function<absl::StatusOr<FileAbout>(const std::string& path)> look =
        AboutFile;
    /// As RemoveFile; tests make it slow.
    std::function<void(const std::string& path)> remove = RemoveFile;
    /// Told of each folder that could not be read at the start.
    OnUnreadable on_unreadable = [](auto&&, auto&&) {};
    /// False: names are not the digests of the content, which is not checked.
    bool are_digests = true;
  };

  /// Opens the folder, which is made if need be, and removes what a crash left
  /// half written. Blobs beyond the capacity stay until room is needed.
  /// UNAVAILABLE: the folder cannot be used.
  static absl::StatusOr<std::unique_ptr<DirectoryBlobStore>> Open(
      const std::string& folder, std::int64_t capacity_bytes);
  static absl::StatusOr<std::unique_ptr<DirectoryBlobStore>> Open(
      const std::string& folder, std::int64_t capacity_bytes, Options options);

  /// Removes what a crash left half written in such a folder, whose room may be
  /// needed before it is opened.
  static void Tidy(const std::string& folder);

  absl::Status Put(const BlobKey& key, std::string bytes, Keep keep) override;
  bool Pin(const BlobKey& key) override;
  void PinWhenThere(const BlobKey& key) override;
  void Unpin(const BlobKey& key) override;
  absl::StatusOr<Blob> Get(const BlobKey& key) override;
  void Remove(const BlobKey& key) override;
  bool Has(const BlobKey& key) override;
  bool HasWhole(const BlobKey& key) override;
  bool MakeTenantRoom(const BlobKey& key, std::int64_t bytes,
                      std::int64_t limit) override;
  bool CanMakeRoom(std::int64_t bytes) const override;
  absl::Status TryWriting(std::int64_t bytes) override;
  std::int64_t size_bytes() const override;

 private:
  DirectoryBlobStore(const std::string& folder, std::int64_t capacity_bytes,
                     Options options);

  /// Fills the index from the folder, the last written as the last used.
  absl::Status Scan();

  std::string PathOf(const BlobKey& key) const;
  /// Another one each time.
  std::string TemporaryPath();

  /// Writes the file; its room has been made.
  absl::Status Write(const BlobKey& key, const std::string& bytes);
  /// As Write; RESOURCE_EXHAUSTED when there is no memory for it.
  absl::Status WriteWithinMemory(const BlobKey& key, const std::string& bytes);

  /// Puts what is there already, if the file holds `bytes`, or can be neither
  /// read nor written just now.
  bool PutAgain(const BlobKey& key, const std::string& bytes, int pins);

  /// Puts a file of before in the index that is not there, since its folder
  /// could not be read then. NOT_FOUND: there is none; UNAVAILABLE: it cannot
  /// be looked at just now.
  absl::Status FindFile(const BlobKey& key);

  /// What was known of a blob before its file was looked at.
  struct Seen {
    std::uint64_t version = 0;
    std::int64_t bytes = 0;
  };
  std::optional<Seen> See(const BlobKey& key) const;
  /// The same after FindFile.
  absl::StatusOr<Seen> Find(const BlobKey& key);

  /// The bytes in the file were found not to be what was put; false when others
  /// were put since.
  bool SetDamaged(const BlobKey& key, std::uint64_t version);

  /// Get, once; ABORTED when the blob was put again meanwhile.
  absl::StatusOr<Blob> Read(const BlobKey& key);

  /// Makes the folder of the blob's file. It survives the loss of power.
  absl::Status MakeFolderOf(const BlobKey& key);

  // Files are removed without the lock: who needs it waits for no disk. Nobody
  // writes or looks for one of `leaving_`, nobody removes one of `in_use_`.

  /// Leaves in `evicted` those that are to be unlinked, by Unlink. Others are
  /// in use: who has one counts it again, or it is found when it is asked for.
  void BeginUnlink(std::list<BlobIndex::Entry>& evicted)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void Unlink(const std::list<BlobIndex::Entry>& leaving)
      ABSL_LOCKS_EXCLUDED(mutex_);

  /// Waits until nobody removes the file; then nobody does until EndUse.
  void BeginUse(const BlobKey& key) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void EndUse(const BlobKey& key) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  /// Makes room and counts the bytes as taken before they are written;
  /// BeginUse.
  absl::Status TakeRoom(const BlobKey& key, std::int64_t bytes);

  /// Writes the file and counts it in place of `reserved` bytes; EndUse.
  absl::Status WriteAndAdd(const BlobKey& key, const std::string& bytes,
                           std::int64_t reserved, int pins);

  const std::string folder_;
  const Options options_;
  mutable Mutex mutex_;
  mutable BlobIndex index_ ABSL_GUARDED_BY(mutex_);
  CondVar left_;
  std::set<BlobKey> leaving_ ABSL_GUARDED_BY(mutex_);
  std::multiset<BlobKey> in_use_ ABSL_GUARDED_BY(mutex_);
  /// Bytes of blobs that are being written.
  std::int64_t arriving_bytes_ ABSL_GUARDED_BY(mutex_) = 0;
  /// Those that are known to survive the loss of power.
  std::set<std::string> lasting_folders_ ABSL_GUARDED_BY(mutex_);
  std::uint64_t last_temporary_ ABSL_GUARDED_BY(mutex_) = 0;
};

}  // namespace isomatch
