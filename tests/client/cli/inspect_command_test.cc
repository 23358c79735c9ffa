#include <array>
#include <ostream>
#include <sstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "client/files/mesh_file.h"
#include "tests/client/cli/run_isomatch.h"
#include "tests/support/matchers.h"
#include "tests/support/shapes.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

using testing::AllOf;
using testing::HasSubstr;

class InspectCommandTest : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_THAT(WriteMesh(sphere_, UnitSphere(3)), IsOk());
    ASSERT_THAT(WriteMesh(torus_, Torus(30, 15)), IsOk());
  }
  TemporaryFolder folder_;
  const std::string sphere_ = folder_.Path("sphere.off");
  const std::string torus_ = folder_.Path("torus.ply");
};

TEST_F(InspectCommandTest, TellsOfEachMesh) {
  const CommandOutcome outcome = RunIsomatch({"inspect", sphere_, torus_});
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_THAT(outcome.out,
              AllOf(HasSubstr("sphere.off: OFF, 642 vertices, 1280 faces"),
                    HasSubstr("closed, genus 0, Euler characteristic 2"),
                    HasSubstr("torus.ply: PLY, binary little endian, 450"),
                    HasSubstr("closed, genus 1, Euler characteristic 0"),
                    HasSubstr("about 0."), HasSubstr("would accept it")));
}

TEST_F(InspectCommandTest, JsonHasAllOfThem) {
  const CommandOutcome outcome =
      RunIsomatch({"inspect", sphere_, torus_, "--json"});
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  const auto json = nlohmann::json::parse(outcome.out);
  ASSERT_EQ(json["meshes"].size(), 2u);
  EXPECT_EQ(json["meshes"][0]["path"], sphere_);
  EXPECT_EQ(json["meshes"][1]["components"][0]["genus"], 1);
  EXPECT_EQ(json["meshes"][1]["accepted"], true);
}

TEST_F(InspectCommandTest, ABadFileDoesNotHideTheOthers) {
  const std::string bad = folder_.Write("bad.off", "OFF\n3 1 0\n0 0 0\n");
  const std::string none = folder_.Path("none.off");
  const CommandOutcome text = RunIsomatch({"inspect", none, bad, sphere_});
  EXPECT_EQ(text.status, kExitUsage);
  EXPECT_THAT(text.out, HasSubstr("642 vertices"));
  EXPECT_THAT(text.err, AllOf(HasSubstr("isomatch: MESH: '" + none),
                              HasSubstr("isomatch: MESH: '" + bad)));
  const CommandOutcome json = RunIsomatch({"inspect", bad, sphere_, "--json"});
  EXPECT_EQ(json.status, kExitUsage);
  const auto meshes = nlohmann::json::parse(json.out)["meshes"];
  EXPECT_THAT(meshes[0]["error"].get<std::string>(), HasSubstr("bad.off"));
  EXPECT_EQ(meshes[1]["vertices"], 642);
}

TEST_F(InspectCommandTest, AServerThatDoesNotAnswerIsNamed) {
  const CommandOutcome outcome = RunIsomatch(
      {"inspect", sphere_, "--server", "unix:" + folder_.Path("none.sock")});
  EXPECT_EQ(outcome.status, kExitFailure);
  EXPECT_THAT(outcome.err, AllOf(HasSubstr("--server unix:"),
                                 HasSubstr("there is no such socket")));
}

TEST_F(InspectCommandTest, OutputThatCannotBeWrittenIsToldOnce) {
  std::ostream out(nullptr);
  std::ostringstream err;
  const std::array<const char*, 4> argv = {"isomatch", "inspect",
                                           sphere_.c_str(), torus_.c_str()};
  EXPECT_EQ(RunCommandLine(argv.size(), argv.data(), {out, err, false, {}}),
            kExitFailure);
  EXPECT_EQ(err.str(), "isomatch: standard output cannot be written\n");
}

TEST_F(InspectCommandTest, HelpHasExamples) {
  const CommandOutcome outcome = RunIsomatch({"inspect", "--help"});
  EXPECT_EQ(outcome.status, 0);
  EXPECT_THAT(outcome.out, HasSubstr("Examples:"));
}

}  // namespace
}  // namespace isomatch
