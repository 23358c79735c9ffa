// The commands about jobs of a server, with a real one whose method the test
// controls.

#include <cstdlib>
#include <future>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "absl/strings/str_split.h"
#include "absl/strings/strip.h"
#include "client/cli/job_text.h"
#include "client/files/mesh_file.h"
#include "client/files/text_file.h"
#include "tests/client/cli/run_isomatch.h"
#include "tests/server/test_server.h"
#include "tests/support/matchers.h"
#include "tests/support/shapes.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

using nlohmann::json;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

class JobCommandsTest : public TestServer {
 protected:
  JobCommandsTest() {
    EXPECT_THAT(WriteMesh(x_, UnitSphere(1)), IsOk());
    EXPECT_THAT(WriteMesh(y_, Tetrahedron()), IsOk());
  }

  /// A command that talks to the test's server.
  CommandOutcome Run(std::vector<std::string> arguments,
                     const std::stop_token& stop = {}) {
    arguments.insert(arguments.end(), {"--server", server_->address()});
    return RunIsomatch(arguments, stop);
  }

  /// The name of a new job.
  std::string Submit(const std::vector<std::string>& options = {}) {
    std::vector<std::string> arguments = {"submit", x_, y_};
    arguments.insert(arguments.end(), options.begin(), options.end());
    const CommandOutcome outcome = Run(arguments);
    EXPECT_EQ(outcome.status, kExitSuccess) << outcome.err;
    return std::string(absl::StripSuffix(outcome.out, "\n"));
  }

  /// A job that waits at the gate, running.
  std::string SubmitToGate() {
    gate_open_ = false;
    const int before = matches_;
    std::string name = Submit();
    WaitForMatches(before + 1);
    return name;
  }

  const TemporaryFolder folder_;
  const std::string x_ = folder_.Path("x.off");
  const std::string y_ = folder_.Path("y.off");
  const std::string map_ = folder_.Path("map.txt");
};

TEST_F(JobCommandsTest, SubmitWatchAndGetFromThreeProcesses) {
  const std::string name = Submit();
  EXPECT_THAT(name, StartsWith("jobs/"));
  EXPECT_EQ(Run({"watch", name}).status, kExitSuccess);
  const CommandOutcome got = Run({"get", name, "-o", map_});
  ASSERT_EQ(got.status, kExitSuccess) << got.err;
  // The gated engine maps vertex i to i % |Y|.
  EXPECT_THAT(*ReadFile(map_, "a map"), StartsWith("0\n1\n2\n3\n0\n"));
  // Also without the prefix of the name.
  EXPECT_EQ(Run({"get", name.substr(5), "-o", "-"}).out,
            *ReadFile(map_, "a map"));
}

TEST_F(JobCommandsTest, GetWithoutFilesTellsAboutTheJob) {
  const std::string name = Submit(
      {"--label", "study=spring", "--label", "a=b=c", "--priority", "7"});
  const CommandOutcome text = Run({"get", name, "--wait"});
  EXPECT_EQ(text.status, kExitSuccess);
  EXPECT_THAT(text.out,
              AllOf(HasSubstr(name), HasSubstr("succeeded"),
                    HasSubstr("a=b=c study=spring"), HasSubstr("42 to 4")));
  const auto job = json::parse(Run({"get", name, "--json"}).out);
  EXPECT_EQ(job["state"], "STATE_SUCCEEDED");
  EXPECT_EQ(job["priority"], 7);
  EXPECT_EQ(job["labels"]["study"], "spring");
  EXPECT_EQ(job["queue_position"], 0);  // defaults are there too
}

TEST(FormatJobTest, AQueuedJobTellsWhatItWaitsFor) {
  v1::Job job;
  job.set_state(v1::Job::STATE_QUEUED);
  job.set_queue_position(3);
  EXPECT_THAT(FormatJob(job), HasSubstr("queued  3 ahead\n"));
  job.set_waiting_for(v1::Job::WAIT_REASON_STORAGE);
  EXPECT_THAT(FormatJob(job), HasSubstr("queued  server's disk full\n"));
  job.set_waiting_for(v1::Job::WAIT_REASON_INPUTS);
  EXPECT_THAT(FormatJobs({job}, absl::Now()), HasSubstr("meshes unreadable"));
}

TEST_F(JobCommandsTest, GetWritesEveryFileOfMatch) {
  on_found_ = FindEverything;
  ASSERT_THAT(WriteMesh(x_, Tetrahedron()), IsOk());
  const std::string name = Submit({"--functional-map"});
  ASSERT_EQ(Run({"watch", name}).status, kExitSuccess);
  std::vector<std::string> options = {"--mesh-y", y_};
  std::vector<std::string> matched = {"match", x_, y_};
  for (const char* file : {"output", "report", "precise", "confidence",
                           "alternative", "functional-map"}) {
    const std::string option = std::string("--") + file;
    options.insert(options.end(),
                   {option, folder_.Path(std::string("get_") + file)});
    matched.insert(matched.end(),
                   {option, folder_.Path(std::string("match_") + file)});
  }
  options.insert(options.begin(), {"get", name});
  ASSERT_EQ(Run(options).status, kExitSuccess);
  ASSERT_EQ(Run(matched).status, kExitSuccess);
  for (const char* file :
       {"output", "precise", "confidence", "alternative", "functional-map"}) {
    EXPECT_EQ(*ReadFile(folder_.Path(std::string("get_") + file), "a file"),
              *ReadFile(folder_.Path(std::string("match_") + file), "a file"))
        << file;
  }
  const auto report =
      json::parse(*ReadFile(folder_.Path("get_report"), "a report"));
  EXPECT_EQ(report["mesh_y"]["faces"], 4);
}

TEST_F(JobCommandsTest, GetOfAJobThatGoesOnNeedsWait) {
  const std::string name = SubmitToGate();
  const CommandOutcome early = Run({"get", name, "-o", map_});
  EXPECT_EQ(early.status, kExitFailure);
  EXPECT_THAT(early.err, HasSubstr("has not ended yet"));
  EXPECT_EQ(folder_.CountFiles(), 2);
  auto waiting = std::async(std::launch::async, [&] {
    return Run({"get", name, "--wait", "-o", map_});
  });
  gate_open_ = true;
  EXPECT_EQ(waiting.get().status, kExitSuccess);
  EXPECT_EQ(folder_.CountFiles(), 3);
}

TEST_F(JobCommandsTest, WatchPrintsJsonLinesAndEndsWithTheJob) {
  const CommandOutcome outcome = Run({"watch", Submit(), "--json"});
  EXPECT_EQ(outcome.status, kExitSuccess);
  EXPECT_EQ(outcome.err, "");
  const std::vector<std::string> lines =
      absl::StrSplit(outcome.out, '\n', absl::SkipEmpty());
  ASSERT_FALSE(lines.empty());
  for (const std::string& line : lines) EXPECT_TRUE(json::accept(line)) << line;
  EXPECT_EQ(json::parse(lines.back())["state"], "STATE_SUCCEEDED");
}

TEST_F(JobCommandsTest, StoppingAWatchLeavesTheJobAlone) {
  const std::string name = SubmitToGate();
  std::stop_source stop;
  stop.request_stop();
  EXPECT_EQ(Run({"watch", name}, stop.get_token()).status, kExitInterrupted);
  gate_open_ = true;
  EXPECT_EQ(Run({"watch", name}).status, kExitSuccess);
}

TEST_F(JobCommandsTest, CancelAndDeleteTryEveryJob) {
  const std::string done = Submit();
  ASSERT_EQ(Run({"watch", done}).status, kExitSuccess);
  const std::string running = SubmitToGate();
  const std::string queued = Submit();
  const CommandOutcome cancel = Run({"cancel", done, running, queued});
  EXPECT_EQ(cancel.status, kExitFailure);
  EXPECT_THAT(cancel.err, HasSubstr("SUCCEEDED"));
  gate_open_ = true;
  const CommandOutcome watch = Run({"watch", running});
  EXPECT_EQ(watch.status, kExitFailure);
  EXPECT_THAT(watch.err, HasSubstr("cancelled on the server"));
  EXPECT_EQ(GetJob(queued).state(), v1::Job::STATE_CANCELLED);

  const CommandOutcome deleted = Run({"delete", done, "jobs/none", queued});
  EXPECT_EQ(deleted.status, kExitUsage);
  EXPECT_THAT(deleted.err, HasSubstr("jobs/none"));
  EXPECT_THAT(Run({"list", "--names"}).out, running + "\n");
}

TEST_F(JobCommandsTest, CancelAndDeletePrintJsonOnDemand) {
  const std::string running = SubmitToGate();
  const std::string queued = Submit();
  const CommandOutcome cancel = Run({"cancel", "--json", "jobs/none", queued});
  EXPECT_EQ(json::parse(cancel.out)["state"], "STATE_CANCELLED");
  const CommandOutcome deleted = Run({"delete", "--json", queued});
  EXPECT_EQ(json::parse(deleted.out),
            json({{"name", queued}, {"deleted", true}}));
  gate_open_ = true;
}

TEST_F(JobCommandsTest, ListNarrowsByStateLabelAndNumber) {
  const std::string spring = Submit({"--label", "study=spring"});
  const std::string autumn = Submit({"--label", "study=autumn"});
  ASSERT_EQ(Run({"watch", spring}).status, kExitSuccess);
  ASSERT_EQ(Run({"watch", autumn}).status, kExitSuccess);
  const std::string running = SubmitToGate();
  EXPECT_EQ(Run({"list", "--names"}).out,
            running + "\n" + autumn + "\n" + spring + "\n");
  EXPECT_EQ(Run({"list", "--names", "--label", "study=spring"}).out,
            spring + "\n");
  EXPECT_EQ(Run({"list", "--names", "--state", "Running"}).out, running + "\n");
  EXPECT_EQ(Run({"list", "--names", "--limit", "1"}).out, running + "\n");
  const std::string table = Run({"list"}).out;
  EXPECT_THAT(table, AllOf(StartsWith("JOB"), HasSubstr("study=autumn"),
                           HasSubstr("succeeded"), HasSubstr("running")));
  const std::vector<std::string> lines =
      absl::StrSplit(Run({"list", "--json"}).out, '\n', absl::SkipEmpty());
  ASSERT_EQ(lines.size(), 3U);
  EXPECT_EQ(json::parse(lines[1])["name"], autumn);
  gate_open_ = true;
}

TEST_F(JobCommandsTest, UploadSaysWhatTheServerKnew) {
  const CommandOutcome first = Run({"upload", x_, y_});
  ASSERT_EQ(first.status, kExitSuccess) << first.err;
  EXPECT_THAT(first.out, Not(HasSubstr("known")));
  const CommandOutcome again = Run({"upload", x_});
  EXPECT_THAT(again.out, HasSubstr(x_ + "  (known)\n"));
  EXPECT_EQ(again.out.substr(0, 64), first.out.substr(0, 64));
  const json line = json::parse(Run({"upload", x_, "--json"}).out);
  EXPECT_EQ(line["sha256"], first.out.substr(0, 64));
  EXPECT_EQ(line["path"], x_);
  EXPECT_EQ(line["known"], true);
  EXPECT_GT(line["size_bytes"], 10);
}

TEST_F(JobCommandsTest, InfoTellsLimitsAndLoad) {
  const std::string name = SubmitToGate();
  const CommandOutcome text = Run({"info"});
  ASSERT_EQ(text.status, kExitSuccess) << text.err;
  EXPECT_THAT(text.out, AllOf(HasSubstr("1 running, 0 queued"),
                              HasSubstr("in memory"), HasSubstr("ready")));
  const auto info = json::parse(Run({"info", "--json"}).out);
  EXPECT_EQ(info["running_jobs"], 1);
  EXPECT_EQ(info["limits"]["max_vertices"], 5'000'000);
  gate_open_ = true;
}

TEST(ServerInfoTextTest, AGatewayWithoutWorkersSaysThatJobsWait) {
  v1::GetServerInfoResponse info;
  info.set_threads_per_job(2);
  std::string text = FormatServerInfo(info);
  EXPECT_THAT(
      text, AllOf(HasSubstr("none is running: jobs wait\n"),
                  Not(HasSubstr("threads a job")), Not(HasSubstr("reserved"))));
  info.set_workers(3);
  info.set_memory_budget_bytes(4'000'000);
  text = FormatServerInfo(info);
  EXPECT_THAT(text, AllOf(HasSubstr("3, 2 threads a job\n"),
                          HasSubstr("0 of 4 MB reserved\n")));
}

TEST_F(JobCommandsTest, TimeoutsEndTheJob) {
  const std::string name = SubmitToGate();
  const std::string queued = Submit({"--queue-timeout", "50ms"});
  const CommandOutcome watch = Run({"watch", queued});
  EXPECT_EQ(watch.status, kExitFailure);
  EXPECT_THAT(watch.err, HasSubstr("QUEUE_TIMEOUT"));
  gate_open_ = true;
}

TEST_F(JobCommandsTest, WrongWordsAreNamed) {
  const auto expect_error = [&](const std::vector<std::string>& arguments,
                                const std::string& why) {
    const CommandOutcome outcome = Run(arguments);
    EXPECT_EQ(outcome.status, kExitUsage) << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr(why));
    EXPECT_EQ(outcome.out, "");
  };
  expect_error({"submit", x_, y_, "--label", "spring"}, "expected KEY=VALUE");
  expect_error({"submit", x_, y_, "--label", "a=1", "--label", "a=2"},
               "'a' is given twice");
  expect_error({"submit", x_, y_, "--queue-timeout", "soon"},
               "--queue-timeout is 'soon', expected a duration");
  expect_error({"submit", x_, y_, "--run-timeout", "-1s"}, "--run-timeout");
  expect_error({"submit", x_, folder_.Path("none.off")}, "Y: '");
  expect_error({"list", "--state", "lost"},
               "expected one of queued, running, succeeded, failed, cancelled");
  expect_error({"list", "--limit", "0"}, "limit");
  expect_error({"get", "jobs/none"}, "jobs/none");
  expect_error({"get", "jobs/none", "--precise", map_}, "--mesh-y");
  expect_error({"watch", "none"}, "jobs/none");
  expect_error({"upload", folder_.Path("none.off")}, "MESH: '");
}

TEST_F(JobCommandsTest, TheEnvironmentNamesTheServer) {
  setenv("ISOMATCH_SERVER", server_->address().c_str(), 1);
  const CommandOutcome outcome = RunIsomatch({"info"});
  unsetenv("ISOMATCH_SERVER");
  EXPECT_EQ(outcome.status, kExitSuccess) << outcome.err;
}

}  // namespace
}  // namespace isomatch
