#include "server/convert/result_info.h"

#include <cstdint>
#include <limits>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "server/storage/job_record_codec.h"
#include "tests/support/matchers.h"

namespace isomatch {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr std::uint64_t kSeed = std::numeric_limits<std::uint64_t>::max();

JobResult Described(const JobSpec& spec, const Correspondence& found) {
  JobResult result;
  result.info = DescribeResult(spec, {10, 20}, {11, 21}, found);
  return result;
}

TEST(ResultInfoTest, TellsAllThatIsKnownOfMeshesAndMap) {
  JobSpec spec;
  spec.landmarks = {{1, 2}, {3, 4}};
  spec.warnings = {"of the request"};
  spec.options = MatchOptions::ForProfile(Profile::kPaper);
  spec.options.random_seed = kSeed;
  Correspondence found;
  found.y_from_x = {0, kNoVertex, 1};
  found.area_x = 0.5;
  found.warnings_y = {"of y"};
  found.warnings = {"of the map"};
  found.scores = {1, 2, 3, 4, 5, 6, 7, 8};
  found.quality = {.1, .2, .3, 0, .4};
  found.verdict = {VerdictLevel::kBad, "the reason", "the advice"};
  found.symmetry_confidence = 0.75;
  found.alternatives = {{{}, {.rank_value = kInfinity}}};
  found.landmarks = {{true, 2, 0}, {false, kNoVertex, 0.25}};
  found.objective = 9;
  const v1::ResultInfo info = ResultInfoOf(Described(spec, found));
  EXPECT_EQ(info.mesh_x().vertices(), 10);
  EXPECT_EQ(info.mesh_y().faces(), 21);
  EXPECT_EQ(info.mesh_x().area(), 0.5);
  EXPECT_THAT(info.mesh_y().warnings(), ElementsAre("of y"));
  EXPECT_THAT(info.warnings(), ElementsAre("of the request", "of the map"));
  EXPECT_EQ(info.unmatched(), 1);
  EXPECT_EQ(info.embedding_error(), 1);
  EXPECT_EQ(info.orientation_score(), 2);
  EXPECT_EQ(info.scores().curvature_mismatch(), 3);
  EXPECT_EQ(info.scores().rank_value(), 8);
  EXPECT_EQ(info.quality().geodesic_distortion(), .1);
  EXPECT_EQ(info.quality().mean_confidence(), .4);
  EXPECT_EQ(info.verdict().level(), v1::Verdict::LEVEL_BAD);
  EXPECT_EQ(info.verdict().reason(), "the reason");
  EXPECT_EQ(info.verdict().advice(), "the advice");
  EXPECT_EQ(info.symmetry_confidence(), 0.75);
  EXPECT_EQ(info.alternatives(0).scores().rank_value(), kInfinity);
  EXPECT_EQ(info.landmarks(1).landmark().y(), 4);
  EXPECT_FALSE(info.landmarks(1).kept());
  EXPECT_EQ(info.landmarks(1).y_found(), 0xFFFFFFFF);
  EXPECT_EQ(info.landmarks(1).distance(), 0.25);
  EXPECT_EQ(info.objective(), 9);
  EXPECT_EQ(info.profile(), v1::PROFILE_PAPER);
  EXPECT_EQ(info.random_seed(), kSeed);
}

// As the records of version 0.1.0 had it until there was `info`.
nlohmann::json OldResult() {
  return {
      {"mesh_x",
       {{"vertices", 10}, {"faces", 20}, {"area", 0.5}, {"warnings", {"x"}}}},
      {"unmatched", 3},
      {"scores", {{"embedding_error", 1.5}, {"orientation_score", -1.0}}},
      {"quality", {{"coverage", .25}}},
      {"verdict", {{"level", 2}, {"reason", "r"}, {"advice", "a"}}},
      {"symmetry_confidence", .5},
      {"alternatives", {{{"rank_value", kInfinity}}}},
      {"landmarks",
       {{{"landmark", {{"x", 1}, {"y", 2}}},
         {"kept", false},
         {"y_found", -1},
         {"distance", .125}}}},
      {"warnings", {"w"}},
      {"profile", 1},
      {"random_seed", kSeed}};
}

TEST(ResultInfoTest, RecordsOfBeforeAreTold) {
  JobResult result;
  nlohmann::json::to_cbor(OldResult(), result.old_info);
  const v1::ResultInfo info = ResultInfoOf(result);
  EXPECT_EQ(info.mesh_x().faces(), 20);
  EXPECT_THAT(info.mesh_x().warnings(), ElementsAre("x"));
  EXPECT_EQ(info.unmatched(), 3);
  EXPECT_EQ(info.embedding_error(), 1.5);
  EXPECT_EQ(info.orientation_score(), -1);
  EXPECT_EQ(info.quality().coverage(), .25);
  EXPECT_EQ(info.verdict().level(), v1::Verdict::LEVEL_DOUBTFUL);
  EXPECT_EQ(info.alternatives(0).scores().rank_value(), kInfinity);
  EXPECT_EQ(info.landmarks(0).landmark().y(), 2);
  EXPECT_EQ(info.landmarks(0).y_found(), 0xFFFFFFFF);
  EXPECT_EQ(info.landmarks(0).distance(), .125);
  EXPECT_THAT(info.warnings(), ElementsAre("w"));
  EXPECT_EQ(info.profile(), v1::PROFILE_PAPER);
  EXPECT_EQ(info.random_seed(), kSeed);
}

TEST(ResultInfoTest, WhatCannotBeReadIsSaid) {
  const auto says_so = [](const JobResult& result) {
    const v1::ResultInfo info = ResultInfoOf(result);
    EXPECT_EQ(info.warnings_size(), 1);
    EXPECT_THAT(info.warnings(0), HasSubstr("cannot be read"));
    EXPECT_FALSE(info.has_mesh_x());
  };
  JobResult result = Described({}, {});
  result.info.pop_back();
  says_so(result);
  result.old_info = "no CBOR";
  says_so(result);
  nlohmann::json odd = OldResult();
  odd["scores"] = "a text";
  result.old_info.clear();
  nlohmann::json::to_cbor(odd, result.old_info);
  says_so(result);
}

}  // namespace
}  // namespace isomatch
