#include "client/cli/command_line.h"

#include <algorithm>
#include <csignal>
#include <sstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "client/files/map_file.h"
#include "client/files/mesh_file.h"
#include "client/files/text_file.h"
#include "core/evaluation/geodesic_error.h"
#include "tests/client/cli/run_isomatch.h"
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

TEST_F(CommandLineTest, HelpSaysWhatItsOptionSays) {
  const CommandOutcome help = Run({"help", "match"});
  EXPECT_EQ(help.status, kExitSuccess);
  EXPECT_EQ(Run({"help", "sample"}).out, Run({"sample", "--help"}).out);
  EXPECT_THAT(
      help.out,
      AllOf(HasSubstr("--landmarks FILE"), HasSubstr("--random-seed SEED"),
            HasSubstr("--memory-limit BYTES"), HasSubstr("Files to write:"),
            HasSubstr("Server:")));
  EXPECT_THAT(help.out, Not(HasSubstr("TEXT")));
  EXPECT_THAT(help.out, Not(HasSubstr("UINT")));
  EXPECT_EQ(Run({"help"}).out, Run({"--help"}).out);
}

TEST_F(CommandLineTest, MistypedWordsAreRecognized) {
  ExpectUsageError({"mtach", "x", "y"},
                   "isomatch: there is no command 'mtach', did you mean "
                   "'match'?");
  ExpectUsageError({"insp"}, "did you mean 'inspect'?");
  ExpectUsageError({"help", "veiw"}, "did you mean 'view'?");
  ExpectUsageError({"frobnicate"}, "there is no command 'frobnicate'\n");
  ExpectUsageError({"match", "x", "y", "--ouput", "m.txt"},
                   "isomatch match: there is no option '--ouput', did you mean "
                   "'--output'?");
  // The first of them, in the order given, also where something is missing.
  ExpectUsageError({"match", "--theads=2", "--proifle", "paper"},
                   "there is no option '--theads', did you mean '--threads'?");
  ExpectUsageError({"evaluate", "y", "m", "t", "more"},
                   "isomatch evaluate: 'more' is one file or word too many");
  ExpectUsageError({"match", "x"}, "isomatch match: Y is required");
}

TEST_F(CommandLineTest, NumbersWithoutASignAreRefusedWithOne) {
  for (const char* option :
       {"--random-seed", "--threads", "--solved-vertices", "--memory-limit"}) {
    ExpectUsageError({"match", "x", "y", option, "-1"},
                     absl::StrCat(option, ": '-1', expected "));
  }
  ExpectUsageError({"match", "x", "y", "--random-seed", "1.5"}, "random-seed");
  ExpectUsageError({"sample", "--mesh-seed", "-1", "-o", "a.off"}, "'-1'");
  ExpectUsageError({"batch", "l", "-o", "f", "--parallel", "-1"}, "'-1'");
}

TEST_F(CommandLineTest, OutputsThatWouldHoldSomethingElseAreRefused) {
  const auto refused = [&](const std::vector<std::string>& arguments,
                           const std::string& why) {
    // Before anything is read: the meshes are not there.
    ExpectUsageError(arguments, why);
  };
  refused({"match", "x", "y", "-o", "m.stl"},
          "--output 'm.stl': the extension is '.stl', expected .txt or .npy or "
          ".json or .ply, or no extension");
  refused({"match", "x", "y", "-o", "m.OBJ"}, "the extension is '.obj'");
  refused({"match", "x", "y", "--report", "r.txt"}, "--report 'r.txt'");
  refused({"match", "x", "y", "--precise", "p.npy"}, "--precise 'p.npy'");
  refused({"match", "x", "y", "--confidence", "c.json"}, "--confidence");
  refused({"match", "x", "y", "--functional-map", "f.npy"}, "expected .json");
  refused({"match", "x", "y", "--alternative", "a.jpg"}, "--alternative");
  refused({"view", "x", "y", "m", "--png", "a.jpg"},
          "--png 'a.jpg': the extension is '.jpg', expected .png");
  refused({"view", "x", "y", "m", "-o", "a.pdf"}, "expected .html");
  refused({"transfer", "x", "y", "m", "-o", "a.stl"}, ".obj or .glb or .ply");
  refused(
      {"sample", "-o", "a.off", "--truth", "t.npy", "--truth-from", "A:300"},
      "--truth 't.npy'");
}

TEST_F(CommandLineTest, ExtensionsMayBeInCapitals) {
  const std::string mesh = folder_.Path("a.OFF");
  EXPECT_EQ(Run({"sample", "--vertices", "300", "-o", mesh}).status,
            kExitSuccess);
  const std::string textured = folder_.Path("b.OBJ");
  EXPECT_EQ(Run({"sample", "--vertices", "300", "--texture", "checker", "-o",
                 textured})
                .status,
            kExitSuccess);
  EXPECT_THAT(*ReadFile(textured, "a mesh"), HasSubstr("mtllib"));
  const std::string map = folder_.Path("m.NPY");
  ASSERT_EQ(Run({"match", mesh, textured, "-o", map, "--no-progress"}).status,
            kExitSuccess);
  EXPECT_THAT(*ReadFile(map, "a map"), HasSubstr("NUMPY"));
}

// On a terminal; elsewhere the numbers, as ever.
TEST_F(CommandLineTest, APersonGetsASummaryInsteadOfTheNumbers) {
  MakePair(300, 300);
  const auto run = [&](const std::vector<std::string>& more) {
    std::vector<const char*> argv = {"isomatch", "match", a_.c_str(),
                                     b_.c_str(), "--no-progress"};
    for (const std::string& word : more) argv.push_back(word.c_str());
    std::ostringstream out;
    std::ostringstream err;
    const Terminal terminal{out, err, false, {}, true};
    EXPECT_EQ(
        RunCommandLine(static_cast<int>(argv.size()), argv.data(), terminal),
        kExitSuccess)
        << err.str();
    return out.str();
  };
  EXPECT_THAT(run({}),
              AllOf(HasSubstr("300 of 300 vertices of X have a place on Y"),
                    HasSubstr("-o map.txt writes it, -o - prints it")));
  const std::string numbers = run({"-o", "-"});
  EXPECT_EQ(std::count(numbers.begin(), numbers.end(), '\n'), 300);
  EXPECT_EQ(Run({"match", a_, b_, "--no-progress"}).out, numbers);
  EXPECT_EQ(run({"-o", map_}), "");
}

TEST_F(CommandLineTest, MoreThreadsThanThereAreSayNothing) {
  MakePair(300, 300);
  testing::internal::CaptureStderr();  // of libraries
  const CommandOutcome outcome =
      Run({"match", a_, b_, "-o", map_, "--no-progress", "--threads", "1000"});
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
  EXPECT_EQ(outcome.status, kExitSuccess) << outcome.err;
  EXPECT_THAT(outcome.err, Not(HasSubstr("threads")));
  ExpectUsageError({"match", a_, b_, "--threads", "1025"},
                   "expected a whole number from 0 to 1024");
}

TEST_F(CommandLineTest, ADeadlineTakesTheMapThatIsThere) {
  MakePair(300, 300);
  const auto run = [&](const std::string& deadline) {
    const CommandOutcome outcome =
        Run({"match", a_, b_, "-o", map_, "--json", "--no-progress",
             "--deadline", deadline});
    EXPECT_EQ(outcome.status, kExitSuccess) << outcome.err;
    return outcome.out;
  };
  EXPECT_THAT(run("1ms"), AllOf(HasSubstr("\"ended_early\": true"),
                                HasSubstr("time was up")));
  EXPECT_THAT(run("1h"), HasSubstr("\"ended_early\": false"));
  for (const char* const wrong : {"soon", "-1s", "0s", "inf"}) {
    ExpectUsageError({"match", a_, b_, "--deadline", wrong},
                     "expected a duration above 0");
  }
  ExpectUsageError({"match", a_, b_, "--deadline=1s", "--profile", "paper"},
                   "--deadline");
}

TEST_F(CommandLineTest, ASoupIsWeldedOnDemand) {
  MakePair(300, 300);
  // Every face of A for itself, its corners off by up to 1e-6.
  const TriangleMesh mesh = ReadMesh(a_, "X")->mesh;
  TriangleMesh soup = {Positions(3 * mesh.num_faces(), 3),
                       Faces(mesh.num_faces(), 3)};
  for (VertexIndex f = 0; f < mesh.num_faces(); ++f) {
    for (int i = 0; i < 3; ++i) {
      const VertexIndex v = 3 * f + i;
      soup.faces(f, i) = v;
      soup.positions.row(v) =
          mesh.positions.row(mesh.faces(f, i)) +
          1e-6 * Eigen::RowVector3d(v % 7 / 7.0, v % 5 / 5.0, v % 3 / 3.0);
    }
  }
  const std::string path = folder_.Path("soup.off");
  ASSERT_THAT(WriteMesh(path, soup), IsOk());
  const CommandOutcome told = Run({"inspect", path});
  EXPECT_THAT(told.out, HasSubstr("probably a triangle soup; try --weld "));
  const std::size_t advice = told.out.find("try --weld ") + 11;
  const std::string tolerance =
      told.out.substr(advice, told.out.find_first_of(" \n", advice) - advice);
  ASSERT_EQ(Run({"match", a_, b_, "-o", map_, "--no-progress"}).status,
            kExitSuccess);
  const VertexMap expected = *ReadMap(map_, 300);
  const CommandOutcome welded = Run(
      {"match", path, b_, "-o", map_, "--no-progress", "--weld", tolerance});
  ASSERT_EQ(welded.status, kExitSuccess) << welded.err;
  EXPECT_THAT(welded.err, HasSubstr("vertices were moved to others within"));
  EXPECT_THAT(welded.err, Not(HasSubstr("components")));
  const VertexMap found = *ReadMap(map_, 300, soup.num_vertices());
  EXPECT_THAT(found, testing::Each(testing::Ge(0)));
  // What they are matched to is what A's own vertices are.
  const GeodesicErrorMeter meter(ReadMesh(b_, "Y")->mesh);
  VertexMap of_corners;
  for (const VertexIndex v : mesh.faces.reshaped<Eigen::RowMajor>()) {
    of_corners.push_back(expected[static_cast<std::size_t>(v)]);
  }
  EXPECT_LT(meter.Measure(found, of_corners)->mean_over_diameter, 0.05);
}

// A weld drops faces; those of a precise map have the numbers of the file.
TEST_F(CommandLineTest, APreciseMapOfAWeldNamesTheFacesOfTheFile) {
  MakePair(300, 300);
  const LoadedMesh b = *ReadMesh(b_, "Y");
  // A vertex within the first face, at its first corner but for rounding.
  TriangleMesh dense = b.mesh;
  const VertexIndex extra = dense.num_vertices();
  dense.positions.conservativeResize(extra + 1, 3);
  dense.positions.row(extra) =
      dense.positions.row(dense.faces(0, 0)) * (1 + 1e-9);
  const Eigen::RowVector3i first = b.mesh.faces.row(0);
  dense.faces.resize(b.mesh.num_faces() + 2, 3);
  dense.faces << first[0], first[1], extra,  //
      first[2], first[0], extra,             //
      first[1], first[2], extra,             //
      b.mesh.faces.bottomRows(b.mesh.num_faces() - 1);
  const std::string path = folder_.Path("dense.off");
  const std::string precise = folder_.Path("precise.txt");
  ASSERT_THAT(WriteMesh(path, dense), IsOk());
  const CommandOutcome welded =
      Run({"match", a_, path, "-o", map_, "--precise", precise, "--weld",
           "1e-6", "--no-progress"});
  ASSERT_EQ(welded.status, kExitSuccess) << welded.err;
  const auto error = [&](const std::vector<std::string>& weld) {
    std::vector<std::string> arguments = {"evaluate", path, precise, truth_,
                                          "--json"};
    arguments.insert(arguments.end(), weld.begin(), weld.end());
    const CommandOutcome outcome = Run(arguments);
    EXPECT_EQ(outcome.status, kExitSuccess) << outcome.err;
    return nlohmann::json::parse(outcome.out)["direct"]["mean_over_diameter"]
        .get<double>();
  };
  EXPECT_LT(error({}), 0.05);
  EXPECT_NEAR(error({"--weld", "1e-6"}), error({}), 1e-3);
}

TEST_F(CommandLineTest, WrongUsageExitsWith2) {
  MakePair(300, 300);
  const std::string missing = folder_.Path("none.off");
  const std::string landmarks = folder_.Write("lm.txt", "0 1\n0 300\n");
  ExpectUsageError({}, "isomatch: expected a command");
  ExpectUsageError({"match", a_}, "Y");
  ExpectUsageError({"match", a_, b_, "--profile", "fast"}, "profile");
  ExpectUsageError({"match", a_, b_, "--threads", "many"}, "threads");
  ExpectUsageError({"match", a_, b_, "--priority", "101"}, "priority");
  ExpectUsageError({"match", a_, b_, "--solved-vertices", "-1"}, "solved");
  // The server knows the range.
  ExpectUsageError(
      {"match", a_, b_, "--no-progress", "--solved-vertices", "499"},
      "--solved-vertices: 499, expected 0 or 500 to");
  ExpectUsageError({"match", a_, b_, "--no-progress", "--memory-limit", "2MB"},
                   "--memory-limit: 2 MB, expected at least");
  ExpectUsageError({"match", a_, b_, "--memory-limit", "much"}, "memory-limit");
  for (const char* address : {"", "host", "host:", ":1", "host:65536",
                              "http://host:1", "host/path:1"}) {
    ExpectUsageError({"match", a_, b_, "--server", address}, "HOST:PORT");
  }
  ExpectUsageError({"match", a_, b_, "--server", "https://host:443"},
                   "expected HOST:PORT without https://");
  const std::string both = folder_.Path("both.json");
  ExpectUsageError({"match", a_, b_, "-o", both, "--report", both},
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
  ExpectUsageError({"sample", "-o", folder_.Path("a.stl")},
                   ".off, .ply or .glb");
  EXPECT_EQ(folder_.CountFiles(), 4);
}

TEST_F(CommandLineTest, UnreachableServerExitsWith1AndWritesNothing) {
  MakePair(300, 300);
  const absl::Time begin = absl::Now();
  const CommandOutcome outcome =
      Run({"match", a_, b_, "-o", map_, "--server", "127.0.0.1:1"});
  EXPECT_EQ(outcome.status, kExitFailure);
  EXPECT_THAT(
      outcome.err,
      HasSubstr("--server 127.0.0.1:1: nobody listens there (connection "
                "refused); start isomatch-server, or name another"));
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

TEST_F(CommandLineTest, EvaluateTellsHowWellAnOverlapIsFound) {
  const std::string x = folder_.Write(
      "x.off", "OFF\n4 2 0\n0 0 0\n6 0 0\n0 1 0\n-1 0 0\n3 0 1 2\n3 0 2 3\n");
  MakePair(300, 300);
  const auto evaluate = [&](const std::string& map, const std::string& truth,
                            const std::vector<std::string>& options) {
    std::vector<std::string> arguments = {"evaluate", b_,
                                          folder_.Write("m.txt", map),
                                          folder_.Write("t.txt", truth)};
    arguments.insert(arguments.end(), options.begin(), options.end());
    const CommandOutcome outcome = Run(arguments);
    EXPECT_EQ(outcome.status, kExitSuccess) << outcome.err;
    return outcome.out;
  };
  // Areas are 7, 6, 7 and 1 sixths; both have 0 and 2.
  const std::string map = "5\n5\n5\n-1\n";
  const std::string truth = "0 5\n1 -1\n2 5\n3 5\n";
  EXPECT_THAT(evaluate(map, truth, {}),
              AllOf(HasSubstr("direct: 3 vertices compared, 1 without a match"),
                    HasSubstr("IoU of the overlap, by number of vertices "
                              "0.50000\n")));
  EXPECT_THAT(evaluate(map, truth, {"--mesh-x", x}),
              HasSubstr("IoU of the overlap, by area of X 0.66667\n"));
  // What the truth does not name counts in neither.
  EXPECT_THAT(evaluate(map, "0 5\n2 5\n3 5\n", {}), HasSubstr(" 0.66667\n"));
  EXPECT_THAT(evaluate(map, "0 5\n2 5\n", {}), Not(HasSubstr("IoU")));
  const auto json =
      nlohmann::json::parse(evaluate(map, truth, {"--json", "--mesh-x", x}));
  EXPECT_NEAR(json["iou"].get<double>(), 14.0 / 21, 1e-12);
  EXPECT_EQ(json["iou_weights"], "area");
  EXPECT_EQ(nlohmann::json::parse(evaluate(map, "0 5\n", {"--json"}))["iou"],
            1);
  ExpectUsageError({"evaluate", b_, folder_.Write("m.txt", "5\n"),
                    folder_.Path("t.txt"), "--mesh-x", x},
                   "1 entries, expected 4, one for each vertex of X");
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
