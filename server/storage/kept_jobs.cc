#include "server/storage/kept_jobs.h"

#include <algorithm>
#include <iterator>
#include <utility>

namespace isomatch {
namespace {

std::int64_t ResultBytesOf(const JobRecord& record) {
  std::int64_t bytes = 0;
  if (!record.result) return bytes;
  for (const StoredPart& part : record.result->parts) bytes += part.bytes;
  return bytes;
}

}  // namespace

void KeptJobs::Add(const JobRecord& record) {
  const std::int64_t bytes = ResultBytesOf(record);
  Group& group = groups_[{record.result.has_value(), record.tenant}];
  group.jobs[record.sequence] = {record.id,
                                 std::max(record.end_time, record.aged_from),
                                 record.end_steady, bytes};
  group.result_bytes += bytes;
}

void KeptJobs::Remove(const JobRecord& record) {
  const auto group = groups_.find({record.result.has_value(), record.tenant});
  const auto job = group->second.jobs.find(record.sequence);
  group->second.result_bytes -= job->second.result_bytes;
  group->second.jobs.erase(job);
  if (group->second.jobs.empty()) groups_.erase(group);
}

class KeptJobs::Selection {
 public:
  Selection(const KeepLimits& limits, std::uint64_t newest)
      : limits_(limits), newest_(newest), room_bytes_(limits.room_bytes) {}

  /// Adds what is not too old of a group; the others go.
  void Add(const Group& group, std::vector<std::string>& ids) {
    Line line;
    for (auto job = group.jobs.begin(); job != group.jobs.end(); ++job) {
      if (IsTooOld(job->second)) {
        ids.push_back(job->second.id);
        room_bytes_ -= job->second.result_bytes;
        continue;
      }
      line.left.push_back(job);
      line.bytes += job->second.result_bytes;
    }
    line.jobs = std::ssize(line.left);
    jobs_ += line.jobs;
    bytes_ += line.bytes;
    lines_.push_back(std::move(line));
  }

  void TakeExcess(std::vector<std::string>& ids) {
    for (Line& line : lines_) {
      while (line.jobs > limits_.max_jobs_per_tenant && MayGo(line)) {
        Take(line, ids);
      }
    }
    while (jobs_ > limits_.max_jobs && TakeOfLargest(&Line::jobs, ids)) {
    }
    const std::int64_t most_bytes =
        std::min(limits_.max_result_bytes,
                 std::max<std::int64_t>(0, bytes_ - room_bytes_));
    while (bytes_ > most_bytes && TakeOfLargest(&Line::bytes, ids)) {
    }
  }

 private:
  /// What is left of a tenant's, the oldest first.
  struct Line {
    std::vector<Jobs::const_iterator> left;
    size_t next = 0;
    std::int64_t jobs = 0;
    std::int64_t bytes = 0;

    const Jobs::value_type& oldest() const { return *left[next]; }
  };

  bool IsTooOld(const Job& job) const {
    return job.aged_from < limits_.ended_before &&
           job.end_steady < limits_.ended_before_steady;
  }

  bool MayGo(const Line& line) const {
    return line.next < line.left.size() && line.oldest().first != newest_;
  }

  void Take(Line& line, std::vector<std::string>& ids) {
    const Job& job = line.oldest().second;
    ids.push_back(job.id);
    --line.jobs;
    --jobs_;
    line.bytes -= job.result_bytes;
    bytes_ -= job.result_bytes;
    ++line.next;
  }

  bool TakeOfLargest(std::int64_t Line::*size, std::vector<std::string>& ids) {
    const auto largest = std::max_element(
        lines_.begin(), lines_.end(), [&](const Line& a, const Line& b) {
          if (!MayGo(a) || !MayGo(b)) return !MayGo(a) && MayGo(b);
          // Among equals the oldest goes.
          return a.*size != b.*size ? a.*size < b.*size
                                    : a.oldest().first > b.oldest().first;
        });
    if (largest == lines_.end() || !MayGo(*largest)) return false;
    Take(*largest, ids);
    return true;
  }

  const KeepLimits& limits_;
  const std::uint64_t newest_;
  std::int64_t room_bytes_;
  std::vector<Line> lines_;
  std::int64_t jobs_ = 0;
  std::int64_t bytes_ = 0;
};

std::vector<std::string> KeptJobs::Excess(const KeepLimits& limits) const {
  std::uint64_t newest = 0;
  for (const auto& [key, group] : groups_) {
    if (group.jobs.empty()) continue;  // memory ended while one was added
    newest = std::max(newest, group.jobs.rbegin()->first);
  }
  std::vector<std::string> ids;
  for (const bool has_result : {false, true}) {
    Selection selection(limits, newest);
    for (const auto& [key, group] : groups_) {
      if (key.first == has_result) selection.Add(group, ids);
    }
    selection.TakeExcess(ids);
  }
  return ids;
}

}  // namespace isomatch
