#pragma once

#include <chrono>
#include <cstdint>
#include <list>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "server/storage/blob_store.h"

namespace isomatch {

/// What a store knows of its blobs: how large they are, how often pinned, when
/// last used. MakeRoom keeps them within `capacity_bytes` in all.
///
/// Not thread-safe.
class BlobIndex {
 public:
  struct Entry {
    BlobKey key;
    std::int64_t bytes = 0;
    int pins = 0;
    /// The bytes are lost until somebody puts them again.
    bool is_damaged = false;
    /// It was pinned although its bytes were not found: they may turn up.
    bool is_awaited = false;
    /// A new number each time that the bytes are put.
    std::uint64_t version = 0;
    /// When the bytes were last read and found whole.
    std::chrono::steady_clock::time_point whole_at = {};
    /// The bytes, as long as somebody holds them.
    std::weak_ptr<const std::string> held = {};
    /// The bytes, in a store that has them nowhere else.
    BlobStore::Blob blob = nullptr;
  };

  explicit BlobIndex(std::int64_t capacity_bytes)
      : capacity_bytes_(capacity_bytes) {}

  /// Returns the entry, now the most recently used; null for none.
  Entry* Touch(const BlobKey& key);

  /// Takes out entries that are neither pinned nor (with `blob`) in use, the
  /// least recently used first, until `bytes` more fit. RESOURCE_EXHAUSTED when
  /// they cannot; nothing is taken out then.
  absl::StatusOr<std::list<Entry>> MakeRoom(std::int64_t bytes);

  /// Returns the most bytes that MakeRoom can make room for.
  std::int64_t RoomBytes() const;

  /// As MakeRoom, but takes out only entries of the key's tenant, and not the
  /// key's own, until `bytes` and the tenant's other entries are at most
  /// `limit` together. Takes out nothing when the key's bytes are there
  /// undamaged.
  absl::StatusOr<std::list<Entry>> MakeTenantRoom(const BlobKey& key,
                                                  std::int64_t bytes,
                                                  std::int64_t limit);

  /// Adds an entry as the most recently used one.
  /// REQUIRES: the key is new.
  Entry& Add(Entry entry);

  /// Notes that the bytes of an entry were put again, and how many they are
  /// now.
  void Renew(Entry& entry, std::int64_t bytes);

  /// Takes an entry out; nothing when it is not there.
  void Remove(const BlobKey& key);

  /// Adds or takes back pins; false when the entry is not there. Never below 0.
  bool ChangePins(const BlobKey& key, int change);

  std::int64_t size_bytes() const { return size_bytes_; }
  std::int64_t capacity_bytes() const { return capacity_bytes_; }

 private:
  using Entries = std::vector<std::list<Entry>::iterator>;

  std::list<Entry> TakeOut(const Entries& victims);

  const std::int64_t capacity_bytes_;
  /// Most recently used first.
  std::list<Entry> entries_;
  std::map<BlobKey, std::list<Entry>::iterator> by_key_;
  std::int64_t size_bytes_ = 0;
  std::uint64_t last_version_ = 0;
};

}  // namespace isomatch
