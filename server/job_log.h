#pragma once

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "server/storage/job_record.h"

namespace isomatch {

/// Logs a change of state, once for each, as JobManager's on_state is called:
/// failures as warnings, everything else as information.
void LogState(const JobRecord& job, absl::Time now);

/// Logs, as an error, that a job was asked to stop and did not.
void LogStuck(const JobRecord& job);

/// Logs why results cannot be stored; with OK that they can again.
void LogStorage(const absl::Status& storage);

/// Logs, as a warning, that a job has lost its worker, or this process the job,
/// for a silence.
void LogLeaseLost(const JobRecord& job, bool is_ours);

/// Logs why the database cannot be used; with OK that it can again.
void LogDatabase(const absl::Status& database);

}  // namespace isomatch
