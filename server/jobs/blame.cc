#include "server/jobs/blame.h"

#include <algorithm>

namespace isomatch {
namespace {

/// A match answers within a quarter of a second, and tells of its progress ten
/// times a second where it can.
constexpr absl::Duration kTooLong = absl::Seconds(1);

/// Those that are the cause, whether or not they may run again.
std::vector<JobTrace> CausesOf(const ProcessTrace& trace) {
  std::vector<JobTrace> deaf;
  for (const JobTrace& job : trace.jobs) {
    if (job.unanswered && *job.unanswered >= kTooLong) deaf.push_back(job);
  }
  if (!deaf.empty() || trace.jobs.empty()) return deaf;
  if (trace.resident_bytes <= trace.expected_bytes) return {};
  const JobTrace& most_silent = *std::max_element(
      trace.jobs.begin(), trace.jobs.end(),
      [](const JobTrace& a, const JobTrace& b) { return a.silent < b.silent; });
  if (most_silent.silent >= kTooLong || trace.jobs.size() == 1) {
    return {most_silent};
  }
  return {};
}

}  // namespace

std::set<std::string> JobsToBlame(const ProcessTrace& trace,
                                  const std::vector<JobRecord>& ran) {
  std::set<std::string> to_blame;
  for (const JobTrace& cause : CausesOf(trace)) {
    for (const JobRecord& record : ran) {
      if (record.id == cause.id && record.attempt == cause.attempt) {
        to_blame.insert(record.id);
      }
    }
  }
  return to_blame;
}

}  // namespace isomatch
