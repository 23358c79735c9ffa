#include "server/storage/kept_jobs.h"

#include <algorithm>

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
  group.jobs[record.sequence] = {record.id, record.end_time, bytes};
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
      : limits_(limits), newest_(newest) {}

  void Add(const Group& group) {
    lines_.push_back({group.jobs.begin(), group.jobs.end(),
                      static_cast<std::int64_t>(group.jobs.size()),
                      group.result_bytes});
    jobs_ += lines_.back().jobs;
    bytes_ += lines_.back().bytes;
  }

  void TakeExcess(std::vector<std::string>& ids) {
    for (Line& line : lines_) {
      while (line.next != line.end &&
             line.next->second.end_time < limits_.ended_before) {
        Take(line, ids);
      }
      while (line.jobs > limits_.max_jobs_per_tenant && MayGo(line)) {
        Take(line, ids);
      }
    }
    while (jobs_ > limits_.max_jobs && TakeOfLargest(&Line::jobs, ids)) {
    }
    while (bytes_ > limits_.max_result_bytes &&
           TakeOfLargest(&Line::bytes, ids)) {
    }
  }

 private:
  /// What is left of a tenant's, the oldest first.
  struct Line {
    Jobs::const_iterator next;
    Jobs::const_iterator end;
    std::int64_t jobs;
    std::int64_t bytes;
  };

  bool MayGo(const Line& line) const {
    return line.next != line.end && line.next->first != newest_;
  }

  void Take(Line& line, std::vector<std::string>& ids) {
    const Job& job = line.next->second;
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
                                    : a.next->first > b.next->first;
        });
    if (largest == lines_.end() || !MayGo(*largest)) return false;
    Take(*largest, ids);
    return true;
  }

  const KeepLimits& limits_;
  const std::uint64_t newest_;
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
      if (key.first == has_result) selection.Add(group);
    }
    selection.TakeExcess(ids);
  }
  return ids;
}

}  // namespace isomatch
