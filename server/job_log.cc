#include "server/job_log.h"

#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_split.h"
#include "server/logging/log.h"

namespace isomatch {
namespace {

void AddError(const JobError& error, std::string& message, LogFields& fields) {
  absl::StrAppend(&message, ": ", error.reason, ": ", error.message);
  fields.insert(fields.end(), {{"reason", error.reason},
                               {"code", absl::StatusCodeToString(error.code)},
                               {"error", error.message}});
}

void AddResult(const JobRecord& job, std::string& message, LogFields& fields) {
  const JobResult& result = *job.result;
  absl::StrAppendFormat(&message,
                        ", ran %.1f s, estimate %d MiB, process peak %d MiB",
                        result.run_seconds, job.memory_estimate_bytes >> 20,
                        result.peak_resident_bytes >> 20);
  fields.insert(fields.end(),
                {{"run_seconds", result.run_seconds},
                 {"memory_estimate_bytes", job.memory_estimate_bytes},
                 {"memory_measured_bytes", result.peak_resident_bytes}});
}

/// Returns the second field of a W3C traceparent; "" of none.
std::string TraceIdOf(const std::string& trace_parent) {
  const std::vector<std::string> fields = absl::StrSplit(trace_parent, '-');
  return fields.size() < 2 ? "" : fields[1];
}

}  // namespace

void LogState(const JobRecord& job, absl::Time now) {
  const double seconds = absl::ToDoubleSeconds(now - job.create_time);
  const std::string state = JobStateName(job.state);
  std::string message =
      absl::StrFormat("job %s %s after %.1f s", job.id, state, seconds);
  LogFields fields = {{"job", job.id},
                      {"tenant", job.tenant},
                      {"state", state},
                      {"seconds", seconds}};
  if (!job.call_id.empty()) {
    absl::StrAppend(&message, ", request ", job.call_id);
    fields.push_back({"request_id", job.call_id});
  }
  if (const std::string trace = TraceIdOf(job.trace_parent); !trace.empty()) {
    absl::StrAppend(&message, ", trace ", trace);
    fields.push_back({"trace_id", trace});
  }
  if (job.hold > absl::ZeroDuration()) {
    absl::StrAppend(&message, ", held for ", absl::FormatDuration(job.hold),
                    ": ", job.hold_reason);
    fields.push_back({"held", job.hold_reason});
  }
  if (job.error) AddError(*job.error, message, fields);
  if (job.result) AddResult(job, message, fields);
  Log(job.error ? LogLevel::kWarning : LogLevel::kInfo, message, fields);
}

void LogStuck(const JobRecord& job) {
  Log(LogLevel::kError,
      absl::StrCat("job ", job.id, " was asked to stop and did not (fault ",
                   job.faults, " of this job): its worker is given up"),
      {{"job", job.id},
       {"tenant", job.tenant},
       {"state", JobStateName(job.state)}});
}

void LogLeaseLost(const JobRecord& job, bool is_ours) {
  const std::string message =
      is_ours ? absl::StrCat("job ", job.id,
                             " is given up: the database has not heard of this "
                             "process for the time of --lease, and others may "
                             "have the job")
              : absl::StrCat("job ", job.id, " is taken from worker ",
                             job.worker, ", which was silent for the time of ",
                             "--lease (attempt ", job.attempt, ", faults ",
                             job.faults, " before)");
  Log(LogLevel::kWarning, message,
      {{"job", job.id}, {"tenant", job.tenant}, {"worker", job.worker}});
}

void LogDatabase(const absl::Status& database) {
  if (database.ok()) {
    Log(LogLevel::kInfo, "the database can be used again");
  } else {
    Log(LogLevel::kError,
        absl::StrCat("the database cannot be used: ", database.message()));
  }
}

void LogStorage(const absl::Status& storage) {
  if (storage.ok()) {
    Log(LogLevel::kInfo, "results can be stored again, waiting jobs start");
    return;
  }
  Log(LogLevel::kError,
      absl::StrCat("results cannot be stored, jobs wait until they can: ",
                   storage.message()));
}

}  // namespace isomatch
