#include "server/storage/memory_job_store.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"

namespace isomatch {
namespace {

absl::Status NotFound(const std::string& id) {
  return absl::NotFoundError(absl::StrCat("no job ", id));
}

std::int64_t ResultBytes(const JobRecord& record) {
  std::int64_t bytes = 0;
  if (!record.result) return bytes;
  for (const StoredPart& part : record.result->parts) bytes += part.bytes;
  return bytes;
}

bool HasState(const JobRecord& record, const std::vector<JobState>& states) {
  return states.empty() ||
         std::find(states.begin(), states.end(), record.state) != states.end();
}

}  // namespace

absl::StatusOr<JobRecord> MemoryJobStore::Insert(JobRecord record) {
  MutexLock lock(mutex_);
  const bool named = !record.request_id.empty();
  if (records_.count(record.id) != 0 ||
      (named && by_request_id_.count(record.request_id) != 0)) {
    return absl::AlreadyExistsError(absl::StrCat("job ", record.id));
  }
  record.sequence = ++last_sequence_;
  record.number = ++last_number_;
  by_number_[record.number] = record.id;
  if (named) by_request_id_[record.request_id] = record.id;
  records_[record.id] = record;
  return record;
}

absl::StatusOr<JobRecord> MemoryJobStore::Update(JobRecord record) {
  MutexLock lock(mutex_);
  const auto position = records_.find(record.id);
  if (position == records_.end()) return NotFound(record.id);
  const JobRecord& stored = position->second;
  if (stored.sequence != record.sequence) {
    return absl::AbortedError(absl::StrCat("job ", record.id, " is at ",
                                           stored.sequence, ", not at ",
                                           record.sequence));
  }
  record.sequence = ++last_sequence_;
  if (IsTerminal(record.state)) {
    terminal_.erase(stored.sequence);
    terminal_[record.sequence] = record.id;
    result_bytes_ += ResultBytes(record) - ResultBytes(stored);
  }
  position->second = record;
  return record;
}

std::optional<JobRecord> MemoryJobStore::Get(const std::string& id) const {
  MutexLock lock(mutex_);
  const auto position = records_.find(id);
  if (position == records_.end()) return std::nullopt;
  return position->second;
}

std::optional<JobRecord> MemoryJobStore::FindByRequestId(
    const std::string& request_id) const {
  MutexLock lock(mutex_);
  const auto position = by_request_id_.find(request_id);
  if (position == by_request_id_.end()) return std::nullopt;
  return records_.at(position->second);
}

std::vector<JobRecord> MemoryJobStore::List(const JobFilter& filter) const {
  std::vector<JobRecord> found;
  MutexLock lock(mutex_);
  auto position = filter.before_number == 0
                      ? by_number_.end()
                      : by_number_.lower_bound(filter.before_number);
  const auto limit = static_cast<size_t>(std::max(filter.limit, 0));
  while (position != by_number_.begin() && found.size() < limit) {
    --position;
    const JobRecord& record = records_.at(position->second);
    if (HasState(record, filter.states)) found.push_back(record);
  }
  return found;
}

absl::StatusOr<JobRecord> MemoryJobStore::Delete(const std::string& id) {
  MutexLock lock(mutex_);
  const auto position = records_.find(id);
  if (position == records_.end()) return NotFound(id);
  if (!IsTerminal(position->second.state)) {
    return absl::FailedPreconditionError(
        absl::StrCat("job ", id, " is ", JobStateName(position->second.state)));
  }
  return Remove(position);
}

std::vector<JobRecord> MemoryJobStore::Prune(int max_jobs,
                                             std::int64_t max_result_bytes) {
  std::vector<JobRecord> removed;
  MutexLock lock(mutex_);
  while (terminal_.size() > 1 &&
         (terminal_.size() > static_cast<size_t>(max_jobs) ||
          result_bytes_ > max_result_bytes)) {
    removed.push_back(Remove(records_.find(terminal_.begin()->second)));
  }
  return removed;
}

JobRecord MemoryJobStore::Remove(Records::iterator position) {
  JobRecord record = std::move(position->second);
  records_.erase(position);
  by_number_.erase(record.number);
  terminal_.erase(record.sequence);
  if (!record.request_id.empty()) by_request_id_.erase(record.request_id);
  result_bytes_ -= ResultBytes(record);
  return record;
}

}  // namespace isomatch
