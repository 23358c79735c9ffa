#include "server/storage/memory_job_store.h"

#include <algorithm>
#include <cstddef>
#include <utility>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

/// Added to the sequence numbers of an earlier process: more than the changes
/// that it can have made since the last one that the journal has. So watchers
/// never see a smaller number after a crash than before it.
constexpr std::uint64_t kSequenceGap = std::uint64_t{1} << 32;

/// Jobs that are removed from the journal in one change: a full disk has no
/// room for a large one.
constexpr size_t kRemovedAtOnce = 32;

absl::Status NotFound(const std::string& id) {
  return absl::NotFoundError(absl::StrCat("no job ", id));
}

/// Whether more has changed than what a run tells of itself.
bool IsKept(const JobRecord& before, const JobRecord& after) {
  return after.state != before.state || after.attempt != before.attempt ||
         after.faults != before.faults ||
         after.unresponsive != before.unresponsive || IsTerminal(after.state);
}

bool HasLabels(const JobRecord& record,
               const std::map<std::string, std::string>& labels) {
  return std::includes(record.labels.begin(), record.labels.end(),
                       labels.begin(), labels.end());
}

bool Matches(const JobRecord& record, const JobFilter& filter) {
  if (filter.tenant && *filter.tenant != record.tenant) return false;
  if (!HasLabels(record, filter.labels)) return false;
  const std::vector<JobState>& states = filter.states;
  return states.empty() ||
         std::find(states.begin(), states.end(), record.state) != states.end();
}

}  // namespace

MemoryJobStore::MemoryJobStore(const std::vector<JobRecord>& records,
                               JobJournal* journal, OnError on_error,
                               std::uint64_t first_number)
    : journal_(journal), on_error_(std::move(on_error)) {
  MutexLock lock(mutex_);
  last_number_ = first_number - 1;
  for (const JobRecord& record : records) {
    last_sequence_ = std::max(last_sequence_, record.sequence + kSequenceGap);
    last_number_ = std::max(last_number_, record.number);
    Add(record);
  }
}

absl::StatusOr<JobRecord> MemoryJobStore::Insert(JobRecord record) {
  MutexLock writing(writer_mutex_);
  {
    MutexLock lock(mutex_);
    const bool named = !record.request_id.empty();
    if (records_.count(record.id) != 0 ||
        (named && by_request_.count({record.tenant, record.request_id}) != 0)) {
      return absl::AlreadyExistsError(absl::StrCat("job ", record.id));
    }
    record.sequence = ++last_sequence_;
    record.number = ++last_number_;
  }
  ISOMATCH_RETURN_IF_ERROR(WriteJournal({record}));
  MutexLock lock(mutex_);
  Add(record);
  return record;
}

absl::StatusOr<JobRecord> MemoryJobStore::Update(JobRecord record) {
  {
    MutexLock lock(mutex_);
    ISOMATCH_ASSIGN_OR_RETURN(JobRecord* const stored, FindSame(record));
    if (!IsKept(*stored, record)) return Advance(std::move(record), *stored);
  }
  return Keep(std::move(record));
}

absl::StatusOr<JobRecord*> MemoryJobStore::FindSame(const JobRecord& record) {
  const auto position = records_.find(record.id);
  if (position == records_.end()) return NotFound(record.id);
  JobRecord& stored = position->second;
  if (stored.sequence != record.sequence) {
    return absl::AbortedError(absl::StrCat("job ", record.id, " is at ",
                                           stored.sequence, ", not at ",
                                           record.sequence));
  }
  return &stored;
}

absl::StatusOr<JobRecord> MemoryJobStore::Advance(JobRecord record,
                                                  JobRecord& stored) {
  if (being_kept_ == record.id) {
    return absl::FailedPreconditionError(
        absl::StrCat("another change of job ", record.id, " is being kept"));
  }
  record.sequence = ++last_sequence_;
  stored = record;
  return record;
}

absl::StatusOr<JobRecord> MemoryJobStore::Keep(JobRecord record) {
  MutexLock writing(writer_mutex_);
  JobRecord copy = record;  // nothing has changed if memory ends here
  {
    MutexLock lock(mutex_);
    ISOMATCH_RETURN_IF_ERROR(FindSame(record).status());
    record.sequence = copy.sequence = ++last_sequence_;
    being_kept_ = record.id;
  }
  const auto kept = absl::MakeCleanup([this] {
    MutexLock lock(mutex_);
    being_kept_.clear();
  });
  const absl::Status written = WriteJournal({record});
  if (!written.ok()) {
    unwritten_.insert(record.id);
    on_error_(written);
  }
  MutexLock lock(mutex_);
  JobRecord& stored = records_.at(record.id);
  if (IsTerminal(record.state)) {
    terminal_.Add(record);
    if (IsTerminal(stored.state)) terminal_.Remove(stored);
  }
  stored = std::move(copy);
  return record;
}

absl::StatusOr<JobRecord> MemoryJobStore::Get(const std::string& id) const {
  MutexLock lock(mutex_);
  const auto position = records_.find(id);
  if (position == records_.end()) return NotFound(id);
  return position->second;
}

absl::StatusOr<JobRecord> MemoryJobStore::FindByRequestId(
    const std::string& tenant, const std::string& request_id) const {
  MutexLock lock(mutex_);
  const auto position = by_request_.find({tenant, request_id});
  if (position == by_request_.end()) {
    return absl::NotFoundError(absl::StrCat("no job of request ", request_id));
  }
  return records_.at(position->second);
}

absl::StatusOr<bool> MemoryJobStore::HasInput(const std::string& tenant,
                                              const std::string& sha256) const {
  MutexLock lock(mutex_);
  return std::any_of(records_.begin(), records_.end(), [&](const auto& entry) {
    const JobRecord& record = entry.second;
    return record.tenant == tenant &&
           std::find(record.inputs.begin(), record.inputs.end(), sha256) !=
               record.inputs.end();
  });
}

absl::StatusOr<std::vector<JobRecord>> MemoryJobStore::List(
    const JobFilter& filter) const {
  std::vector<JobRecord> found;
  MutexLock lock(mutex_);
  auto position = filter.before_number == 0
                      ? by_number_.end()
                      : by_number_.lower_bound(filter.before_number);
  const auto limit = static_cast<size_t>(std::max(filter.limit, 0));
  while (position != by_number_.begin() && found.size() < limit) {
    --position;
    const JobRecord& record = records_.at(position->second);
    if (Matches(record, filter)) found.push_back(record);
  }
  return found;
}

absl::StatusOr<JobRecord> MemoryJobStore::Delete(const std::string& id) {
  MutexLock writing(writer_mutex_);
  ISOMATCH_ASSIGN_OR_RETURN(JobRecord record, Get(id));
  if (!IsTerminal(record.state)) {
    return absl::FailedPreconditionError(
        absl::StrCat("job ", id, " is ", JobStateName(record.state)));
  }
  if (journal_ != nullptr) ISOMATCH_RETURN_IF_ERROR(journal_->Remove({id}));
  unwritten_.erase(id);
  MutexLock lock(mutex_);
  Remove(id);
  return record;
}

absl::StatusOr<std::vector<JobRecord>> MemoryJobStore::Prune(
    const KeepLimits& limits) {
  MutexLock writing(writer_mutex_);
  std::vector<JobRecord> removed;
  std::vector<std::string> ids;
  {
    MutexLock lock(mutex_);
    ids = terminal_.Excess(limits);
    for (const std::string& id : ids) removed.push_back(records_.at(id));
  }
  const auto gone = static_cast<std::ptrdiff_t>(RemoveFromJournal(ids));
  ids.resize(static_cast<size_t>(gone));
  removed.erase(removed.begin() + gone, removed.end());
  MutexLock lock(mutex_);
  for (const std::string& id : ids) {
    unwritten_.erase(id);
    Remove(id);
  }
  return removed;
}

size_t MemoryJobStore::RemoveFromJournal(const std::vector<std::string>& ids) {
  if (journal_ == nullptr) return ids.size();
  size_t done = 0;
  while (done < ids.size()) {
    const size_t end = std::min(done + kRemovedAtOnce, ids.size());
    const absl::Status status =
        journal_->Remove({ids.begin() + static_cast<std::ptrdiff_t>(done),
                          ids.begin() + static_cast<std::ptrdiff_t>(end)});
    if (!status.ok()) {
      on_error_(status);
      break;
    }
    done = end;
  }
  return done;
}

void MemoryJobStore::Add(const JobRecord& record) {
  // The record comes first, so that the other tables never name one that is not
  // there, wherever memory runs out.
  records_[record.id] = record;
  by_number_[record.number] = record.id;
  if (!record.request_id.empty()) {
    by_request_[{record.tenant, record.request_id}] = record.id;
  }
  if (IsTerminal(record.state)) terminal_.Add(record);
}

void MemoryJobStore::Remove(const std::string& id) {
  const auto position = records_.find(id);
  const JobRecord& record = position->second;
  by_number_.erase(record.number);
  if (IsTerminal(record.state)) terminal_.Remove(record);
  by_request_.erase({record.tenant, record.request_id});
  records_.erase(position);
}

void MemoryJobStore::Flush() {
  {
    MutexLock writing(writer_mutex_);
    const absl::Status written =
        unwritten_.empty() ? absl::OkStatus() : WriteJournal({});
    if (!written.ok()) on_error_(written);
  }
  if (journal_ != nullptr) journal_->Settle();
}

absl::Status MemoryJobStore::WriteJournal(std::vector<JobRecord> records) {
  if (journal_ == nullptr) return absl::OkStatus();
  const std::string now = records.empty() ? "" : records.front().id;
  for (const std::string& id : unwritten_) {
    const auto other = Get(id);
    if (other.ok() && id != now) records.push_back(*other);
  }
  ISOMATCH_RETURN_IF_ERROR(journal_->Write(records));
  unwritten_.clear();
  return absl::OkStatus();
}

}  // namespace isomatch
