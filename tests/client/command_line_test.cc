#include "client/command_line.h"

#include <csignal>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "absl/time/clock.h"
#include "client/map_file.h"
#include "client/text_file.h"
#include "tests/client/run_isomatch.h"
#include "tests/server/child_process.h"
#include "tests/support/matchers.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

class CommandLineTest : public testing::Test {
 protected:
  CommandOutcome Run(const std::vector<std::string>& arguments) {
    return RunIsomatch(arguments, stop_.get_token());
  }

  // Two poses and the truth: a.off, b.off, gt.txt.
  void MakePair(int vertices_a, int vertices_b) {
    const std::string a = std::to_string(vertices_a);
    ASSERT_EQ(Run({"sample", "--pose", "A", "--vertices", a, "-o", a_}).status,
              0);
    ASSERT_EQ(
        Run({"sample", "--pose", "B", "--vertices", std::to_string(vertices_b),
             "-o", b_, "--truth-from", "A:" + a, "--truth", truth_})
            .status,
        0);
  }

  void ExpectUsageError(const std::vector<std::string>& arguments,
                        const std::string& why) {
    const CommandOutcome outcome = Run(arguments);
    EXPECT_EQ(outcome.status, kExitUsage) << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr(why));
    EXPECT_EQ(outcome.out, "");
  }

  TemporaryFolder folder_;
  std::stop_source stop_;
  const std::string a_ = folder_.Path("a.off");
  const std::string b_ = folder_.Path("b.off");
  const std::string truth_ = folder_.Path("gt.txt");
  const std::string map_ = folder_.Path("map.txt");
};

TEST_F(CommandLineTest, HelpAndVersionSucceed) {
  EXPECT_EQ(Run({"--version"}).status, kExitSuccess);
  EXPECT_THAT(Run({"--help"}).out, HasSubstr("Examples:"));
  for (const char* command :
       {"match", "evaluate", "transfer", "inspect", "sample"}) {
    const CommandOutcome outcome = Run({command, "--help"});
    EXPECT_EQ(outcome.status, kExitSuccess);
    EXPECT_THAT(outcome.out, HasSubstr("Examples:")) << command;
  }
}

TEST_F(CommandLineTest, WrongUsageExitsWith2) {
  MakePair(300, 300);
  const std::string missing = folder_.Path("none.off");
  const std::string landmarks = folder_.Write("lm.txt", "0 1\n0 300\n");
  ExpectUsageError({}, "subcommand");
  ExpectUsageError({"match", a_}, "Y");
  ExpectUsageError({"match", a_, b_, "--profile", "fast"}, "profile");
  ExpectUsageError({"match", a_, b_, "--threads", "many"}, "threads");
  ExpectUsageError({"match", a_, b_, "--priority", "101"}, "priority");
  ExpectUsageError({"match", a_, b_, "--solved-vertices", "-1"}, "solved");
  // The server knows the range.
  ExpectUsageError(
      {"match", a_, b_, "--no-progress", "--solved-vertices", "499"},
      "options.solved_vertices: 499, expected 0 or 500 to");
  ExpectUsageError({"match", a_, b_, "--no-progress", "--memory-limit", "2MB"},
                   "options.memory_limit_bytes: 2000000, expected at least");
  ExpectUsageError({"match", a_, b_, "--memory-limit", "much"}, "memory-limit");
  for (const char* address : {"", "host", "host:", ":1", "host:65536"}) {
    ExpectUsageError({"match", a_, b_, "--server", address}, "HOST:PORT");
  }
  ExpectUsageError({"match", a_, b_, "-o", map_, "--report", map_},
                   "is the file of --output too");
  ExpectUsageError({"match", a_, b_, "--json"}, "expected -o FILE");
  ExpectUsageError({"match", missing, b_}, "X: '" + missing);
  ExpectUsageError({"match", a_, missing}, "Y: '" + missing);
  ExpectUsageError({"match", a_, b_, "-o", folder_.Path("no/map")},
                   "there is no folder");
  ExpectUsageError({"match", a_, b_, "--landmarks", landmarks},
                   "line 2: y is 300, expected 0 to 299");
  ExpectUsageError({"evaluate", b_, landmarks, truth_}, "line 1");
  ExpectUsageError({"sample", "--pose", "D", "-o", a_}, "expected A, B or C");
  ExpectUsageError({"sample", "--truth", truth_, "-o", a_}, "belong together");
  ExpectUsageError({"sample", "--truth", truth_, "--truth-from", "A", "-o", a_},
                   "expected POSE:VERTICES");
  ExpectUsageError({"sample", "-o", folder_.Path("a.stl")}, ".off or .ply");
  EXPECT_EQ(folder_.CountFiles(), 4);
}

TEST_F(CommandLineTest, UnreachableServerExitsWith1AndWritesNothing) {
  MakePair(300, 300);
  const absl::Time begin = absl::Now();
  const CommandOutcome outcome =
      Run({"match", a_, b_, "-o", map_, "--server", "127.0.0.1:1"});
  EXPECT_EQ(outcome.status, kExitFailure);
  EXPECT_THAT(outcome.err, HasSubstr("--server 127.0.0.1:1: no answer"));
  EXPECT_LT(absl::Now() - begin, absl::Seconds(5));
  EXPECT_EQ(folder_.CountFiles(), 3);
}

TEST_F(CommandLineTest, MatchesEmbeddedAndByServerWithTheSameBytes) {
  MakePair(1500, 1200);
  const std::string report = folder_.Path("report.json");
  const CommandOutcome embedded =
      Run({"match", a_, b_, "-o", map_, "--report", report, "--json"});
  ASSERT_EQ(embedded.status, kExitSuccess) << embedded.err;
  EXPECT_EQ(embedded.out, *ReadFile(report, "a report"));
  EXPECT_THAT(embedded.err, HasSubstr(" %  "));
  const ServerProcess server(ISOMATCH_SERVER_BINARY);
  const CommandOutcome remote =
      Run({"match", a_, b_, "--server", server.address, "--no-progress"});
  ASSERT_EQ(remote.status, kExitSuccess) << remote.err;
  EXPECT_EQ(remote.err, "");
  EXPECT_EQ(remote.out, *ReadFile(map_, "a map"));
  const auto json = nlohmann::json::parse(*ReadFile(report, "a report"));
  EXPECT_EQ(json["mesh_x"]["vertices"], 1500);
  EXPECT_EQ(json["mesh_y"]["faces"], 2 * 1200 - 4);
  EXPECT_EQ(json["profile"], "default");
  EXPECT_FALSE(json["seconds"].empty());
  EXPECT_GT(json["memory_estimate_bytes"], 0);
  const CommandOutcome error = Run({"evaluate", b_, map_, truth_, "--json"});
  ASSERT_EQ(error.status, kExitSuccess) << error.err;
  EXPECT_LT(nlohmann::json::parse(error.out)["direct"]["mean_over_diameter"],
            0.05);
}

TEST_F(CommandLineTest, SampleTellsWhatItWroteAsJson) {
  const CommandOutcome outcome =
      Run({"sample", "--pose", "b", "--vertices", "300", "-o", b_,
           "--truth-from", "A:200", "--truth", truth_, "--json"});
  ASSERT_EQ(outcome.status, kExitSuccess) << outcome.err;
  const auto json = nlohmann::json::parse(outcome.out);
  EXPECT_EQ(json["output"], b_);
  EXPECT_EQ(json["pose"], "B");
  EXPECT_EQ(json["mesh_seed"], 1);
  EXPECT_EQ(json["vertices"], 300);
  EXPECT_EQ(json["faces"], 2 * 300 - 4);
  EXPECT_EQ(json["truth"], truth_);
}

TEST_F(CommandLineTest, TruthHasNoError) {
  MakePair(400, 400);
  const CommandOutcome outcome = Run({"evaluate", b_, truth_, truth_});
  EXPECT_EQ(outcome.status, kExitSuccess) << outcome.err;
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("mean error / diam(Y)       0.0000"),
                                 HasSubstr("100.00 %")));
}

TEST_F(CommandLineTest, InterruptedMatchExitsWith130AndWritesNothing) {
  MakePair(3000, 3000);
  stop_.request_stop();
  const CommandOutcome outcome = Run({"match", a_, b_, "-o", map_});
  EXPECT_EQ(outcome.status, kExitInterrupted) << outcome.err;
  EXPECT_EQ(folder_.CountFiles(), 3);
}

TEST_F(CommandLineTest, AKilledBatchGoesOnWhereItWas) {
  MakePair(1000, 900);
  const std::string c = folder_.Path("c.off");
  ASSERT_EQ(Run({"sample", "--pose", "C", "--vertices", "800", "-o", c}).status,
            kExitSuccess);
  const std::string list =
      folder_.Write("list", "a b\na c\nb c\nb a\nc a\nc b\n");
  const std::vector<std::string> command = {
      "batch", list, "-o", folder_.Path("maps"), "--parallel", "1"};
  {
    ChildProcess batch(ISOMATCH_CLIENT_BINARY, command, folder_.Path("out"));
    batch.ReadUntil("2 of 6 pairs");
    batch.Signal(SIGKILL);
    EXPECT_EQ(batch.ExitStatus(), -1);
  }
  // What the killed one has finished is kept, and the same as of one run.
  const CommandOutcome outcome = Run(command);
  EXPECT_EQ(outcome.status, kExitSuccess) << outcome.err;
  EXPECT_THAT(outcome.out,
              AllOf(HasSubstr("kept from before, 0 failed"),
                    Not(HasSubstr(" 0 kept")), Not(HasSubstr(" 1 kept"))));
  ASSERT_EQ(Run({"match", a_, b_, "-o", map_}).status, kExitSuccess);
  EXPECT_EQ(*ReadFile(folder_.Path("maps/a__b.txt"), "a map"),
            *ReadFile(map_, "a map"));
}

TEST_F(CommandLineTest, CtrlCDuringARunCancelsItOnTheServer) {
  MakePair(8000, 8000);
  const std::string out = folder_.Path("out");
  ServerProcess server(ISOMATCH_SERVER_BINARY);
  ChildProcess match(ISOMATCH_CLIENT_BINARY,
                     {"match", a_, b_, "--server", server.address}, out);
  match.ReadUntil("geodesics");
  match.Signal(SIGINT);
  match.ReadUntil("cancelled by the user");
  EXPECT_EQ(match.ExitStatus(), kExitInterrupted);
  server.process.ReadUntil("CANCELLED");
  EXPECT_THAT(ReadFile(out, "a map"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("empty")));
  EXPECT_EQ(folder_.CountFiles(), 4);
}

}  // namespace
}  // namespace isomatch
