#include "server/jobs/job_metrics.h"

#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"
#include "core/pipeline/progress.h"

namespace isomatch {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

class RecordingMetrics : public Metrics {
 public:
  void JobStarted(absl::Duration waited) override {
    Add("started", absl::FormatDuration(waited));
  }
  void JobEnded(const std::string& state, const std::string& reason) override {
    Add("ended", state, reason);
  }
  void JobRan(const std::string& state, absl::Duration ran) override {
    Add("ran", state, absl::FormatDuration(ran));
  }
  void StageRan(const std::string& stage, absl::Duration ran) override {
    Add("stage", stage, absl::FormatDuration(ran));
  }
  void JobMeasured(double ratio) override {
    Add("measured", absl::StrCat(ratio));
  }

  std::vector<std::string> seen;

 private:
  void Add(const std::string& what, const std::string& a,
           const std::string& b = "") {
    seen.push_back(absl::StrCat(what, " ", a, b.empty() ? "" : " ", b));
  }
};

std::vector<std::string> Count(const JobRecord& job) {
  RecordingMetrics metrics;
  CountState(job, metrics);
  return metrics.seen;
}

JobRecord Job(JobState state) {
  JobRecord job;
  job.state = state;
  job.create_time = absl::FromUnixSeconds(100);
  return job;
}

TEST(JobMetricsTest, AQueuedJobIsNotCountedYet) {
  EXPECT_THAT(Count(Job(JobState::kQueued)), IsEmpty());
}

TEST(JobMetricsTest, AStartedJobTellsHowLongItWaited) {
  JobRecord job = Job(JobState::kRunning);
  job.start_time = absl::FromUnixSeconds(107);
  EXPECT_THAT(Count(job), ElementsAre("started 7s"));
}

TEST(JobMetricsTest, AJobThatNeverRanHasNoRunTime) {
  JobRecord job = Job(JobState::kFailed);
  job.end_time = absl::FromUnixSeconds(130);
  job.error =
      JobError{absl::StatusCode::kDeadlineExceeded, "QUEUE_TIMEOUT", ""};
  EXPECT_THAT(Count(job), ElementsAre("ended FAILED QUEUE_TIMEOUT"));
}

TEST(JobMetricsTest, ASuccessTellsItsStagesAndItsMemory) {
  JobRecord job = Job(JobState::kSucceeded);
  job.start_time = absl::FromUnixSeconds(107);
  job.end_time = absl::FromUnixSeconds(130);
  job.memory_estimate_bytes = 300;
  job.result.emplace();
  job.result->stage_times = {
      {static_cast<std::int32_t>(Stage::kFirstInsertion), 2}};
  job.result->peak_resident_bytes = 200;
  EXPECT_THAT(Count(job),
              ElementsAre("ended SUCCEEDED", "ran SUCCEEDED 23s",
                          "stage first_insertion 2s", "measured 1.5"));
}

TEST(JobMetricsTest, AnUnknownPeakIsLeftOut) {
  JobRecord job = Job(JobState::kSucceeded);
  job.result.emplace();
  EXPECT_THAT(Count(job), ElementsAre("ended SUCCEEDED"));
}

}  // namespace
}  // namespace isomatch
