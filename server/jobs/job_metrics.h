#pragma once

#include "server/metrics/metrics.h"
#include "server/storage/job_record.h"

namespace isomatch {

/// Counts a change of state; call it once for each, as JobManager's on_state
/// is. Queue wait is from creation to the start of this run.
void CountState(const JobRecord& job, Metrics& metrics);

}  // namespace isomatch
