// `isomatch batch`, with a real server whose method the test controls.

#include <filesystem>
#include <future>
#include <memory>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "client/batch/batch_list.h"
#include "client/batch/batch_table.h"
#include "client/files/mesh_file.h"
#include "client/files/text_file.h"
#include "isomatch/v1/service.grpc.pb.h"
#include "server/jobs/errors.h"
#include "server/rpc/grpc_status.h"
#include "tests/client/cli/run_isomatch.h"
#include "tests/client/files/gzip.h"
#include "tests/server/test_server.h"
#include "tests/support/matchers.h"
#include "tests/support/shapes.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::StartsWith;

class BatchTest : public TestServer {
 protected:
  BatchTest() {
    EXPECT_THAT(WriteMesh(folder_.Path("a.off"), UnitSphere(1)), IsOk());
    EXPECT_THAT(WriteMesh(folder_.Path("b.off"), Tetrahedron()), IsOk());
    EXPECT_THAT(WriteMesh(folder_.Path("c.ply"), UnitSphere(0)), IsOk());
  }

  CommandOutcome Batch(std::vector<std::string> arguments,
                       const std::stop_token& stop = {}) {
    arguments.insert(arguments.begin(), "batch");
    arguments.insert(arguments.end(), {"-o", out_, "--no-progress", "--server",
                                       server_->address()});
    return RunIsomatch(arguments, stop);
  }

  /// The states of the rows that a run printed as JSON.
  static std::vector<std::string> States(const CommandOutcome& outcome) {
    std::vector<std::string> states;
    for (const absl::string_view line :
         absl::StrSplit(outcome.out, '\n', absl::SkipEmpty())) {
      states.push_back(json::parse(line)["state"]);
    }
    return states;
  }

  std::string Out(const std::string& name) const { return out_ + "/" + name; }

  const TemporaryFolder folder_;
  const std::string out_ = folder_.Path("out/maps");
  const std::string list_ =
      folder_.Write("pairs.txt", "# two pairs\n\na b\na.off c.ply # sphere\n");
  const std::string packed_list_ =
      folder_.Write("packed.txt.gz", Gzip("a b\na.off c.ply\n"));
};

TEST_F(BatchTest, MatchesEveryPairAndKeepsWhatIsDone) {
  const CommandOutcome first = Batch({list_});
  ASSERT_EQ(first.status, kExitSuccess) << first.err;
  EXPECT_THAT(first.out,
              HasSubstr("2 pairs: 2 done, 0 kept from before, 0 failed"));
  EXPECT_THAT(*ReadFile(Out("a__b.txt"), "a map"), StartsWith("0\n1\n2\n3\n0"));
  EXPECT_EQ(matches_, 2);

  const CommandOutcome again = Batch({list_, "--json"});
  ASSERT_EQ(again.status, kExitSuccess) << again.err;
  EXPECT_THAT(States(again), ElementsAre("kept", "kept"));
  EXPECT_THAT(States(Batch({packed_list_, "--json"})),
              ElementsAre("kept", "kept"));
  EXPECT_EQ(matches_, 2);
  EXPECT_EQ(
      json::parse(again.out.substr(0, again.out.find('\n')))["vertices_x"], 42);

  EXPECT_THAT(States(Batch({list_, "--json", "--force"})),
              ElementsAre("done", "done"));
  EXPECT_EQ(matches_, 4);
}

TEST_F(BatchTest, TheReportTellsWhereTheMeshesAre) {
  ASSERT_EQ(Batch({list_}).status, kExitSuccess);
  const json report = json::parse(*ReadFile(Out("a__c.json"), "a report"));
  EXPECT_EQ(report["batch"]["x"], "../../a.off");
  EXPECT_EQ(report["batch"]["y"], "../../c.ply");
  const CommandOutcome viewed =
      RunIsomatch({"view", out_, "-o", folder_.Path("maps.html"), "--json"});
  ASSERT_EQ(viewed.status, kExitSuccess) << viewed.err;
  EXPECT_EQ(json::parse(viewed.out)["pairs"], 2);
  EXPECT_TRUE(json::parse(viewed.out)["failures"].empty());
}

TEST_F(BatchTest, AReportThatSomebodyChangedHarmsItsPairOnly) {
  ASSERT_EQ(Batch({list_}).status, kExitSuccess);
  json foreign = json::parse(*ReadFile(Out("a__b.json"), "a report"));
  foreign["batch"]["fingerprint"] = 5;
  ASSERT_THAT(WriteFileAtomically(Out("a__b.json"), foreign.dump()), IsOk());
  json changed = json::parse(*ReadFile(Out("a__c.json"), "a report"));
  changed["total_seconds"] = nullptr;
  ASSERT_THAT(WriteFileAtomically(Out("a__c.json"), changed.dump()), IsOk());
  EXPECT_THAT(States(Batch({list_, "--json"})), ElementsAre("done", "failed"));
}

TEST_F(BatchTest, WhatChangedIsMatchedAgain) {
  ASSERT_EQ(Batch({list_}).status, kExitSuccess);
  // Another option, then another mesh, then a damaged and a missing file.
  EXPECT_THAT(States(Batch({list_, "--json", "--random-seed", "2"})),
              ElementsAre("done", "done"));
  ASSERT_THAT(WriteMesh(folder_.Path("b.off"), UnitSphere(0)), IsOk());
  EXPECT_THAT(States(Batch({list_, "--json", "--random-seed", "2"})),
              ElementsAre("done", "kept"));
  ASSERT_THAT(WriteFileAtomically(Out("a__b.txt"), "0\n"), IsOk());
  fs::remove(Out("a__c.json"));
  EXPECT_THAT(States(Batch({list_, "--json", "--random-seed", "2"})),
              ElementsAre("done", "done"));
  EXPECT_EQ(matches_, 7);
}

TEST_F(BatchTest, APairThatFailsDoesNotStopTheOthers) {
  folder_.Write("bad.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 9\n");
  const std::string list = folder_.Write("list", "a bad\na b\n");
  const CommandOutcome outcome = Batch({list});
  EXPECT_EQ(outcome.status, kExitFailure);
  EXPECT_THAT(outcome.err, AllOf(HasSubstr("1 of 2 pairs have no map"),
                                 HasSubstr("bad.off")));
  EXPECT_TRUE(fs::exists(Out("a__b.txt")));
  EXPECT_FALSE(fs::exists(Out("a__bad.txt")));
  EXPECT_THAT(*ReadFile(Out("summary.csv"), "a table"),
              AllOf(StartsWith("x,y,state,"), HasSubstr("\na,bad,failed,"),
                    HasSubstr("\na,b,done,42,4,")));
  // Mended, it is all that is left to do.
  ASSERT_THAT(WriteMesh(folder_.Path("bad.off"), UnitSphere(0)), IsOk());
  EXPECT_THAT(States(Batch({list, "--json"})), ElementsAre("done", "kept"));
}

TEST_F(BatchTest, AStoppedBatchGoesOnWhereItWas) {
  const std::string list = folder_.Write("list", "a b\na c\n");
  gate_open_ = false;
  std::stop_source stop;
  auto batch = std::async(std::launch::async, [&] {
    return Batch({list, "--parallel", "1", "--json"}, stop.get_token());
  });
  WaitForMatches(1);
  stop.request_stop();
  const CommandOutcome stopped = batch.get();
  EXPECT_EQ(stopped.status, kExitInterrupted);
  EXPECT_THAT(States(stopped), ElementsAre("waiting", "waiting"));
  EXPECT_THAT(stopped.err, HasSubstr("goes on where it was"));
  gate_open_ = true;
  EXPECT_THAT(States(Batch({list, "--json"})), ElementsAre("done", "done"));
}

TEST_F(BatchTest, ALostServerEndsTheBatch) {
  const std::string list = folder_.Write("list", "a b\na c\nc b\n");
  server_.reset();
  const CommandOutcome outcome =
      RunIsomatch({"batch", list, "-o", out_, "--server", "127.0.0.1:1"});
  EXPECT_EQ(outcome.status, kExitFailure);
  EXPECT_THAT(outcome.err,
              HasSubstr("--server 127.0.0.1:1: nobody listens there"));
  Restart(TestConfig());
}

TEST_F(BatchTest, AFullQueueIsWaitedFor) {
  ServerConfig config = TestConfig();
  config.max_queued_jobs = 1;
  config.workers = 1;
  Restart(config);
  const std::string list =
      folder_.Write("list", "a b\na c\nc b\nc a\nb c\nb a");
  const CommandOutcome outcome = Batch({list, "--parallel", "6", "--json"});
  EXPECT_EQ(outcome.status, kExitSuccess) << outcome.err;
  EXPECT_THAT(States(outcome), testing::Each("done"));
}

/// A server whose store never has room.
class ServerWithoutRoom final : public v1::CorrespondenceService::Service {
 public:
  ServerWithoutRoom() {
    grpc::ServerBuilder builder;
    builder.AddListeningPort("127.0.0.1:0", grpc::InsecureServerCredentials(),
                             &port_);
    builder.RegisterService(this);
    server_ = builder.BuildAndStart();
  }

  std::string address() const { return absl::StrCat("127.0.0.1:", port_); }

  grpc::Status GetServerInfo(grpc::ServerContext*,
                             const v1::GetServerInfoRequest*,
                             v1::GetServerInfoResponse* response) override {
    response->mutable_limits()->set_max_request_bytes(1 << 20);
    return grpc::Status::OK;
  }

  grpc::Status CreateJob(grpc::ServerContext*, const v1::CreateJobRequest*,
                         v1::CreateJobResponse*) override {
    return ToGrpc(StorageQuota("tenant", 2, 1));
  }

 private:
  int port_ = 0;
  std::unique_ptr<grpc::Server> server_;
};

TEST_F(BatchTest, WhatNoPairMakesRoomForFails) {
  const ServerWithoutRoom full;
  const CommandOutcome outcome =
      RunIsomatch({"batch", list_, "-o", out_, "--parallel", "2", "--json",
                   "--no-progress", "--server", full.address()});
  EXPECT_EQ(outcome.status, kExitFailure);
  EXPECT_THAT(outcome.out, HasSubstr("STORAGE_QUOTA"));
  EXPECT_THAT(States(outcome), testing::Each("failed"));
}

TEST_F(BatchTest, ATemplateIsMatchedToEachMeshOfAFolder) {
  const std::string scans = folder_.Path("scans");
  fs::create_directory(scans);
  fs::copy_file(folder_.Path("b.off"), scans + "/s1.off");
  fs::copy_file(folder_.Path("c.ply"), scans + "/s2.ply");
  std::ofstream(scans + "/notes.txt") << "not a mesh";
  const CommandOutcome outcome =
      Batch({"--template", folder_.Path("a.off"), scans, folder_.Path("a.off"),
             folder_.Path("c.ply")});
  ASSERT_EQ(outcome.status, kExitSuccess) << outcome.err;
  for (const char* name : {"a__s1.txt", "a__s2.txt", "a__c.txt"}) {
    EXPECT_TRUE(fs::exists(Out(name))) << name;
  }
  const CommandOutcome reverse =
      Batch({"--template", folder_.Path("a.off"), scans, "--reverse"});
  ASSERT_EQ(reverse.status, kExitSuccess) << reverse.err;
  EXPECT_TRUE(fs::exists(Out("s1__a.txt")));
}

TEST_F(BatchTest, TruthIsMeasuredAlsoForPairsThatAreKept) {
  // c to c by the gated engine is the identity: no error to itself, some to a
  // shifted truth.
  const std::string list = folder_.Write("list", "c c\n");
  ASSERT_EQ(Batch({list}).status, kExitSuccess);
  const std::string truths = folder_.Path("truths");
  fs::create_directory(truths);
  std::string exact;
  std::string shifted;
  for (int i = 0; i < 12; ++i) {
    absl::StrAppend(&exact, i, " ", i, "\n");
    absl::StrAppend(&shifted, i, " ", (i + 1) % 12, " ", i, "\n");
  }
  std::ofstream(truths + "/gt_c__c.txt") << exact;
  CommandOutcome outcome = Batch({list, "--truth", truths, "--json"});
  ASSERT_EQ(outcome.status, kExitSuccess) << outcome.err;
  EXPECT_EQ(json::parse(outcome.out)["state"], "kept");
  EXPECT_EQ(json::parse(outcome.out)["direct"], 0);
  // Another truth is measured anew; its mirrored column is the better one.
  std::ofstream(truths + "/gt_c__c.txt") << shifted;
  outcome = Batch({list, "--truth", truths, "--json"});
  EXPECT_GT(json::parse(outcome.out)["direct"], 0.1);
  EXPECT_EQ(json::parse(outcome.out)["best"], 0);
  EXPECT_EQ(matches_, 1);
}

TEST_F(BatchTest, PartsAreWrittenOnDemandAndKeptWithThePair) {
  on_found_ = FindEverything;
  const std::vector<std::string> with_parts = {list_, "--json", "--precise",
                                               "--confidence"};
  ASSERT_EQ(Batch({list_}).status, kExitSuccess);
  EXPECT_FALSE(fs::exists(Out("a__b.precise.txt")));
  EXPECT_THAT(States(Batch(with_parts)), ElementsAre("done", "done"));
  const std::string places = *ReadFile(Out("a__b.precise.txt"), "places");
  EXPECT_EQ(std::count(places.begin(), places.end(), '\n'), 42);
  EXPECT_TRUE(fs::exists(Out("a__c.confidence.txt")));
  EXPECT_THAT(States(Batch(with_parts)), ElementsAre("kept", "kept"));
  ASSERT_THAT(WriteFileAtomically(Out("a__b.precise.txt"), "0\n"), IsOk());
  EXPECT_THAT(States(Batch(with_parts)), ElementsAre("done", "kept"));
  // Without them a pair that has them is done, too.
  EXPECT_THAT(States(Batch({list_, "--json"})), ElementsAre("kept", "kept"));
}

TEST_F(BatchTest, OfPartsTheMaskIsWrittenToo) {
  on_found_ = FindEverything;
  const std::string list = folder_.Write("one.txt", "a.off b.off\n");
  ASSERT_EQ(Batch({list}).status, kExitSuccess);
  EXPECT_FALSE(fs::exists(Out("a__b.mask_y.txt")));
  const std::vector<std::string> overlap = {list,      "--json",  "--relation",
                                            "overlap", "--scale", "same"};
  EXPECT_THAT(States(Batch(overlap)), ElementsAre("done"));
  EXPECT_EQ(*ReadFile(Out("a__b.mask_y.txt"), "a mask"), "1\n0\n1\n1\n");
  EXPECT_THAT(States(Batch(overlap)), ElementsAre("kept"));
  ASSERT_THAT(WriteFileAtomically(Out("a__b.mask_y.txt"), "0\n"), IsOk());
  EXPECT_THAT(States(Batch(overlap)), ElementsAre("done"));
}

TEST_F(BatchTest, AnotherDeadlineMakesAnotherMap) {
  const std::string list = folder_.Write("one.txt", "a.off b.off\n");
  ASSERT_EQ(Batch({list}).status, kExitSuccess);
  const std::vector<std::string> hurried = {list, "--json", "--deadline", "1h"};
  EXPECT_THAT(States(Batch(hurried)), ElementsAre("done"));
  EXPECT_THAT(States(Batch(hurried)), ElementsAre("kept"));
}

TEST_F(BatchTest, PathsMayHaveBlanks) {
  ASSERT_THAT(WriteMesh(folder_.Path("my scan #2.off"), Tetrahedron()), IsOk());
  ASSERT_THAT(WriteMesh(folder_.Path("my cat.off"), Tetrahedron()), IsOk());
  const std::string list =
      folder_.Write("spaces.txt",
                    "a \"my scan #2.off\"  # quoted\nmy cat.off\tb.off\t\r\n"
                    "\"my cat\"\tc.ply\n");
  const CommandOutcome outcome = Batch({list});
  ASSERT_EQ(outcome.status, kExitSuccess) << outcome.err;
  EXPECT_TRUE(fs::exists(Out("a__my scan #2.txt")));
  EXPECT_TRUE(fs::exists(Out("my cat__b.txt")));
  EXPECT_TRUE(fs::exists(Out("my cat__c.txt")));
}

TEST_F(BatchTest, WhatEndsALineIsNoBlankBetweenPaths) {
  const std::string list =
      folder_.Write("tabs.txt", "a.off b.off\t\na.off c.ply \t # \"both\"\n");
  EXPECT_EQ(Batch({list}).status, kExitSuccess);
  EXPECT_TRUE(fs::exists(Out("a__b.txt")));
  EXPECT_TRUE(fs::exists(Out("a__c.txt")));
}

TEST_F(BatchTest, PackedMeshesAndPointsOfBothShapesAreListed) {
  fs::copy_file(folder_.Path("a.off"), folder_.Path("d.off.gz"));
  folder_.Write("d.csv", "0 0 1 pole\n");
  ASSERT_EQ(Batch({folder_.Write("list2.txt", "d b d.csv d.csv\n")}).status,
            kExitSuccess);
  EXPECT_TRUE(fs::exists(Out("d__b.txt")));
  EXPECT_THAT(*ReadFile(Out("summary.csv"), "a table"), HasSubstr("\nd,b,"));
  // Other points make the pair new.
  folder_.Write("d.csv", "0 1 0 pole\n");
  const CommandOutcome again = Batch({folder_.Path("list2.txt")});
  EXPECT_THAT(again.out, HasSubstr("1 done, 0 kept from before"));
}

TEST_F(BatchTest, WrongListsAreNamedByLine) {
  const auto expect_error = [&](const std::vector<std::string>& arguments,
                                const std::string& why) {
    const CommandOutcome outcome = Batch(arguments);
    EXPECT_EQ(outcome.status, kExitUsage) << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr(why));
    EXPECT_FALSE(fs::exists(out_));
  };
  expect_error({folder_.Write("l", "a b\na\n")}, "line 2: expected X Y");
  expect_error({folder_.Write("l", "a none\n")}, "line 1: there is no");
  expect_error({folder_.Write("l", "a b\n\"a b\n")},
               "line 2: expected a second \"");
  expect_error({folder_.Write("l", "a b\na.off b.off\n")},
               "line 2: two pairs are named 'a__b'");
  expect_error({folder_.Write("l", "# none\n")}, "found none");
  expect_error({folder_.Path("no_list")}, "no_list");
  expect_error({list_, list_}, "expected one LIST, or --template");
  expect_error({list_, "--reverse"}, "--template");
  expect_error({list_, "--truth", folder_.Path("none")}, "gt_a__b.txt");
  expect_error({"--template", folder_.Path("a.off"), folder_.Path("a.off")},
               "beside the template");
  fs::create_directory(folder_.Path("empty"));
  expect_error({"--template", folder_.Path("a.off"), folder_.Path("empty")},
               "expected a folder with");
}

TEST(BatchTableTest, CsvQuotesWhatNeedsIt) {
  BatchRow row;
  row.x = "a,b";
  row.y = "c";
  row.state = BatchState::kFailed;
  row.message = "say \"no\"";
  EXPECT_THAT(FormatBatchCsv({row}),
              HasSubstr("\n\"a,b\",c,failed,,,,,,,,,,,,\"say \"\"no\"\"\"\n"));
}

TEST(BatchTableTest, MapsThatAreNotGoodAreCounted) {
  BatchRow row;
  row.state = BatchState::kDone;
  row.verdict = "bad";
  EXPECT_THAT(FormatBatchCsv({row}), HasSubstr(",bad,\n"));
  EXPECT_THAT(FormatBatchJson({row}), HasSubstr("\"verdict\":\"bad\""));
  EXPECT_THAT(
      FormatBatchTable({row, row}),
      HasSubstr("2 pairs: 2 done, 0 kept from before, 0 failed, 2 bad"));
  row.state = BatchState::kFailed;
  EXPECT_THAT(FormatBatchTable({row}), testing::Not(HasSubstr(" bad")));
}

}  // namespace
}  // namespace isomatch
