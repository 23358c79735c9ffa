#include "server/job_log.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/server/logging/captured_log.h"

namespace isomatch {
namespace {

using testing::HasSubstr;

JobRecord Job(JobState state) {
  JobRecord job;
  job.id = "abc";
  job.state = state;
  job.create_time = absl::FromUnixSeconds(100);
  return job;
}

nlohmann::json Logged(const JobRecord& job) {
  const CapturedLog log(LogFormat::kJson);
  LogState(job, absl::FromUnixSeconds(103));
  return log.lines().at(0);
}

TEST(JobLogTest, AWorkerThatDoesNotComeBackIsAnError) {
  const CapturedLog log(LogFormat::kJson);
  LogStuck(Job(JobState::kCancelled));
  const nlohmann::json line = log.lines().at(0);
  EXPECT_EQ(line["level"], "error");
  EXPECT_EQ(line["job"], "abc");
  EXPECT_THAT(std::string(line["message"]), HasSubstr("asked to stop"));
}

TEST(JobLogTest, EveryStateIsALine) {
  const nlohmann::json line = Logged(Job(JobState::kQueued));
  EXPECT_EQ(line["message"], "job abc QUEUED after 3.0 s");
  EXPECT_EQ(line["job"], "abc");
  EXPECT_EQ(line["state"], "QUEUED");
  EXPECT_EQ(line["seconds"], 3);
}

TEST(JobLogTest, TheCallThatMadeItIsTold) {
  JobRecord job = Job(JobState::kRunning);
  job.call_id = "r1";
  const nlohmann::json line = Logged(job);
  EXPECT_EQ(line["request_id"], "r1");
  EXPECT_EQ(line["message"], "job abc RUNNING after 3.0 s, request r1");
  EXPECT_FALSE(Logged(Job(JobState::kRunning)).contains("request_id"));
}

TEST(JobLogTest, TheTraceThatItIsPartOfIsTold) {
  JobRecord job = Job(JobState::kRunning);
  job.trace_parent = "00-0af7651916cd43dd8448eb211c80319c-b7ad6b7169203331-01";
  const nlohmann::json line = Logged(job);
  EXPECT_EQ(line["trace_id"], "0af7651916cd43dd8448eb211c80319c");
  EXPECT_EQ(line["message"],
            "job abc RUNNING after 3.0 s, trace "
            "0af7651916cd43dd8448eb211c80319c");
  EXPECT_FALSE(Logged(Job(JobState::kRunning)).contains("trace_id"));
}

TEST(JobLogTest, WhyAJobIsHeldIsTold) {
  JobRecord job = Job(JobState::kQueued);
  job.hold = absl::Seconds(4);
  job.hold_reason = "its mesh is in a file";
  const nlohmann::json line = Logged(job);
  EXPECT_EQ(line["held"], "its mesh is in a file");
  EXPECT_EQ(line["message"],
            "job abc QUEUED after 3.0 s, held for 4s: its mesh is in a file");
}

TEST(JobLogTest, AFailureIsAWarningWithReasonAndCode) {
  JobRecord job = Job(JobState::kFailed);
  job.error = JobError{absl::StatusCode::kDeadlineExceeded, "RUN_TIMEOUT",
                       "it took too long"};
  const nlohmann::json line = Logged(job);
  EXPECT_EQ(line["level"], "warning");
  EXPECT_EQ(line["reason"], "RUN_TIMEOUT");
  EXPECT_EQ(line["code"], "DEADLINE_EXCEEDED");
  EXPECT_THAT(line["message"].get<std::string>(),
              HasSubstr("RUN_TIMEOUT: it took too long"));
}

TEST(JobLogTest, ASuccessTellsTimeAndMemory) {
  JobRecord job = Job(JobState::kSucceeded);
  job.memory_estimate_bytes = 5 << 20;
  job.result.emplace();
  job.result->run_seconds = 2;
  job.result->peak_resident_bytes = 3 << 20;
  const nlohmann::json line = Logged(job);
  EXPECT_EQ(line["run_seconds"], 2);
  EXPECT_EQ(line["memory_estimate_bytes"], 5 << 20);
  EXPECT_EQ(line["memory_measured_bytes"], 3 << 20);
  EXPECT_THAT(line["message"].get<std::string>(),
              HasSubstr("ran 2.0 s, estimate 5 MiB, process peak 3 MiB"));
}

}  // namespace
}  // namespace isomatch
