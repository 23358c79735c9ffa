#include "server/jobs/job_metrics.h"

#include <algorithm>
#include <string>

#include "core/pipeline/progress.h"

namespace isomatch {
namespace {

/// "first_insertion" for "first insertion".
std::string StageLabel(std::int32_t stage) {
  std::string label = StageName(static_cast<Stage>(stage));
  std::replace(label.begin(), label.end(), ' ', '_');
  return label;
}

void CountResult(const JobRecord& job, Metrics& metrics) {
  for (const StageSeconds& stage : job.result->stage_times) {
    metrics.StageRan(StageLabel(stage.stage), absl::Seconds(stage.seconds));
  }
  const std::int64_t peak_bytes = job.result->peak_resident_bytes;
  if (peak_bytes <= 0) return;  // the system does not tell
  metrics.JobMeasured(static_cast<double>(job.memory_estimate_bytes) /
                      static_cast<double>(peak_bytes));
}

}  // namespace

void CountState(const JobRecord& job, Metrics& metrics) {
  if (job.state == JobState::kRunning) {
    metrics.JobStarted(job.start_time - job.create_time);
  }
  if (!IsTerminal(job.state)) return;
  const std::string state = JobStateName(job.state);
  metrics.JobEnded(state, job.error ? job.error->reason : "");
  if (job.start_time != absl::InfinitePast()) {
    metrics.JobRan(state, job.end_time - job.start_time);
  }
  if (job.result) CountResult(job, metrics);
}

}  // namespace isomatch
