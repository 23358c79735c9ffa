#include "server/storage/blob_index.h"

#include <algorithm>
#include <cassert>
#include <iterator>
#include <utility>

#include "absl/strings/str_cat.h"

namespace isomatch {
namespace {

bool MayGo(const BlobIndex::Entry& entry) {
  return entry.pins == 0 && entry.blob.use_count() <= 1;
}

}  // namespace

BlobIndex::Entry* BlobIndex::Touch(const BlobKey& key) {
  const auto found = by_key_.find(key);
  if (found == by_key_.end()) return nullptr;
  entries_.splice(entries_.begin(), entries_, found->second);
  return &*found->second;
}

absl::StatusOr<std::list<BlobIndex::Entry>> BlobIndex::MakeRoom(
    std::int64_t bytes) {
  Entries victims;
  std::int64_t free_bytes = capacity_bytes_ - size_bytes_;
  for (auto entry = entries_.end();
       entry != entries_.begin() && free_bytes < bytes;) {
    --entry;
    if (!MayGo(*entry)) continue;
    free_bytes += entry->bytes;
    victims.push_back(entry);
  }
  if (free_bytes < bytes) {
    return absl::ResourceExhaustedError(
        absl::StrCat("no room for ", bytes, " bytes beside ", size_bytes_,
                     " of ", capacity_bytes_));
  }
  return TakeOut(victims);
}

std::int64_t BlobIndex::RoomBytes() const {
  std::int64_t bytes = capacity_bytes_ - size_bytes_;
  for (const Entry& entry : entries_) {
    if (MayGo(entry)) bytes += entry.bytes;
  }
  return bytes;
}

absl::StatusOr<std::list<BlobIndex::Entry>> BlobIndex::MakeTenantRoom(
    const BlobKey& key, std::int64_t bytes, std::int64_t limit) {
  const auto own = by_key_.find(key);
  if (own != by_key_.end() && !own->second->is_damaged) {
    return std::list<Entry>();
  }
  const auto is_other = [&key](const Entry& entry) {
    return entry.key.tenant == key.tenant && entry.key != key;
  };
  std::int64_t held_bytes = 0;
  for (const Entry& entry : entries_) {
    if (is_other(entry)) held_bytes += entry.bytes;
  }
  Entries victims;
  for (auto entry = entries_.end();
       entry != entries_.begin() && held_bytes + bytes > limit;) {
    --entry;
    if (!is_other(*entry) || !MayGo(*entry)) continue;
    held_bytes -= entry->bytes;
    victims.push_back(entry);
  }
  if (held_bytes + bytes > limit) {
    return absl::ResourceExhaustedError(
        absl::StrCat("no room for ", bytes, " bytes beside ", held_bytes,
                     " of ", key.tenant, ", which may have ", limit));
  }
  return TakeOut(victims);
}

std::list<BlobIndex::Entry> BlobIndex::TakeOut(const Entries& victims) {
  std::list<Entry> evicted;
  for (const auto victim : victims) {
    size_bytes_ -= victim->bytes;
    by_key_.erase(victim->key);
    evicted.splice(evicted.end(), entries_, victim);
  }
  return evicted;
}

BlobIndex::Entry& BlobIndex::Add(Entry entry) {
  assert(by_key_.count(entry.key) == 0);
  std::list<Entry> added;  // nothing has changed if memory ends here
  added.push_front(std::move(entry));
  by_key_.emplace(added.front().key, added.begin());
  entries_.splice(entries_.begin(), added);
  size_bytes_ += entries_.front().bytes;
  entries_.front().version = ++last_version_;
  return entries_.front();
}

void BlobIndex::Renew(Entry& entry, std::int64_t bytes) {
  size_bytes_ += bytes - entry.bytes;
  entry.bytes = bytes;
  entry.is_damaged = false;
  entry.is_awaited = false;
  entry.version = ++last_version_;
}

void BlobIndex::Remove(const BlobKey& key) {
  const auto found = by_key_.find(key);
  if (found == by_key_.end()) return;
  size_bytes_ -= found->second->bytes;
  entries_.erase(found->second);
  by_key_.erase(found);
}

bool BlobIndex::ChangePins(const BlobKey& key, int change) {
  const auto found = by_key_.find(key);
  if (found == by_key_.end()) return false;
  int& pins = found->second->pins;
  pins = std::max(0, pins + change);
  return true;
}

}  // namespace isomatch
