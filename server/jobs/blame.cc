#include "server/jobs/blame.h"

#include <algorithm>
#include <iterator>

namespace isomatch {
namespace {

/// A match answers within a quarter of a second, and tells of its progress ten
/// times a second where it can.
constexpr absl::Duration kTooLong = absl::Seconds(1);

/// What beside a job may have grown while it ran: gRPC's buffers.
constexpr std::int64_t kOthersGrowth = std::int64_t{512} << 20;

bool IsOf(const JobRecord& record, const JobTrace& job) {
  return record.id == job.id && record.attempt == job.attempt;
}

/// Since the job began, by more than it was to take.
bool HasGrown(const ProcessTrace& trace, const JobTrace& job,
              const std::vector<JobRecord>& ran) {
  const std::int64_t growth = trace.resident_bytes - job.resident_at_begin;
  return std::any_of(ran.begin(), ran.end(), [&](const JobRecord& record) {
    return IsOf(record, job) &&
           growth > record.memory_estimate_bytes + kOthersGrowth;
  });
}

template <typename Predicate>
std::vector<JobTrace> JobsThat(const ProcessTrace& trace,
                               const Predicate& predicate) {
  std::vector<JobTrace> jobs;
  std::copy_if(trace.jobs.begin(), trace.jobs.end(), std::back_inserter(jobs),
               predicate);
  return jobs;
}

/// Those that are the cause, whether or not they may run again.
std::vector<JobTrace> CausesOf(const ProcessTrace& trace,
                               const std::vector<JobRecord>& ran) {
  std::vector<JobTrace> causes =
      JobsThat(trace, [](const JobTrace& job) { return job.is_stuck; });
  if (!causes.empty()) return causes;
  causes = JobsThat(trace, [](const JobTrace& job) {
    return job.unanswered && *job.unanswered >= kTooLong;
  });
  if (!causes.empty() || trace.jobs.empty()) return causes;
  if (trace.resident_bytes <= trace.expected_bytes) return {};
  const JobTrace& most_silent = *std::max_element(
      trace.jobs.begin(), trace.jobs.end(),
      [](const JobTrace& a, const JobTrace& b) { return a.silent < b.silent; });
  const bool is_it =
      most_silent.silent >= kTooLong ||
      (trace.jobs.size() == 1 && HasGrown(trace, most_silent, ran));
  return is_it ? std::vector{most_silent} : std::vector<JobTrace>();
}

}  // namespace

Blame WhoIsToBlame(const ProcessTrace& trace,
                   const std::vector<JobRecord>& ran) {
  Blame blame;
  for (const JobTrace& cause : CausesOf(trace, ran)) {
    blame.is_known = true;
    for (const JobRecord& record : ran) {
      if (IsOf(record, cause)) blame.jobs.insert(record.id);
    }
  }
  return blame;
}

}  // namespace isomatch
