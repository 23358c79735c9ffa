#include "core/pipeline/memory_plan.h"

#include <cstdint>
#include <limits>
#include <string>
#include <utility>

#include <gtest/gtest.h>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "core/mesh/mesh_size.h"
#include "core/pipeline/match_options.h"
#include "core/pipeline/matcher.h"
#include "core/pipeline/memory_estimate.h"
#include "core/pipeline/progress.h"
#include "core/pipeline/shape_contents.h"
#include "tests/support/matchers.h"
#include "tests/support/memory_growth.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;

constexpr MeshSize kLarge = {100'000, 200'000};

std::int64_t Estimate(MatchOptions options, int threads) {
  options.threads = threads;
  return EstimateMemoryBytes(kLarge, kLarge, 0, options);
}

MatchOptions Limited(Profile profile, std::int64_t limit, int threads = 2) {
  MatchOptions options = MatchOptions::ForProfile(profile);
  options.memory_limit_bytes = limit;
  options.threads = threads;
  return options;
}

class MemoryPlanTest : public testing::TestWithParam<Profile> {};

TEST_P(MemoryPlanTest, WhatFitsStaysAsItIs) {
  const MatchOptions options = MatchOptions::ForProfile(GetParam());
  for (const std::int64_t limit :
       {std::int64_t{0}, Estimate(options, 2), std::int64_t{1} << 62}) {
    const auto plan =
        PlanWithinMemory(kLarge, kLarge, 0, Limited(GetParam(), limit));
    ASSERT_THAT(plan, IsOk());
    EXPECT_EQ(plan->options.threads, 2);
    EXPECT_EQ(plan->options.solved_vertices, options.solved_vertices);
    EXPECT_THAT(plan->warnings, IsEmpty());
  }
}

TEST_P(MemoryPlanTest, ThreadsGoFirst) {
  const MatchOptions options = MatchOptions::ForProfile(GetParam());
  const std::int64_t limit = Estimate(options, 3);
  ASSERT_LT(limit, Estimate(options, 4));
  const auto plan =
      PlanWithinMemory(kLarge, kLarge, 0, Limited(GetParam(), limit, 64));
  ASSERT_THAT(plan, IsOk());
  EXPECT_EQ(plan->options.threads, 3);
  EXPECT_EQ(plan->options.solved_vertices, options.solved_vertices);
  EXPECT_THAT(plan->warnings, IsEmpty());
}

TEST_P(MemoryPlanTest, ThenVerticesAndAsManyAsFit) {
  const MatchOptions options = MatchOptions::ForProfile(GetParam());
  for (const double share : {0.75, 0.9, 0.99}) {
    const auto limit = static_cast<std::int64_t>(
        share * static_cast<double>(Estimate(options, 1)));
    for (const int threads : {0, 1, 4}) {
      const auto plan = PlanWithinMemory(kLarge, kLarge, 0,
                                         Limited(GetParam(), limit, threads));
      // Full meshes of 100,000 vertices are most of what the default takes.
      if (!plan.ok()) {
        EXPECT_EQ(GetParam(), Profile::kDefault);
        continue;
      }
      EXPECT_LE(Estimate(plan->options, plan->options.threads), limit);
      MatchOptions more = plan->options;
      more.solved_vertices += 100;
      EXPECT_GT(Estimate(more, 1), limit);
      ASSERT_EQ(plan->warnings.size(), 1u);
      EXPECT_THAT(
          plan->warnings[0],
          HasSubstr(absl::StrCat("on ", plan->options.solved_vertices)));
      // The same on any machine.
      EXPECT_EQ(
          plan->options.solved_vertices,
          PlanWithinMemory(kLarge, kLarge, 0, Limited(GetParam(), limit, 16))
              ->options.solved_vertices);
    }
  }
}

TEST_P(MemoryPlanTest, TheErrorSaysWhatWouldDo) {
  const auto plan =
      PlanWithinMemory(kLarge, kLarge, 0, Limited(GetParam(), 1'000'000), 500);
  EXPECT_THAT(plan, StatusIs(absl::StatusCode::kInvalidArgument,
                             HasSubstr("options.memory_limit_bytes: 1000000, "
                                       "expected at least ")));
  const std::string said(plan.status().message());
  std::int64_t least = 0;
  const std::size_t at = said.find("at least ") + 9;
  ASSERT_TRUE(
      absl::SimpleAtoi(said.substr(at, said.find(' ', at) - at), &least));
  EXPECT_THAT(
      PlanWithinMemory(kLarge, kLarge, 0, Limited(GetParam(), least), 500),
      IsOk());
  EXPECT_FALSE(
      PlanWithinMemory(kLarge, kLarge, 0, Limited(GetParam(), least - 1), 500)
          .ok());
}

TEST_P(MemoryPlanTest, HostileSizesDoNotWrapAround) {
  constexpr std::int64_t kHuge = std::numeric_limits<std::int64_t>::max();
  EXPECT_FALSE(PlanWithinMemory({kHuge, kHuge}, kLarge, 0,
                                Limited(GetParam(), 1'000'000), kHuge)
                   .ok());
}

INSTANTIATE_TEST_SUITE_P(Profiles, MemoryPlanTest,
                         testing::Values(Profile::kDefault, Profile::kPaper));

TEST(CheckDecimatedTest, WhatWasDecimatedAsAskedFits) {
  const MatchOptions options =
      Limited(Profile::kDefault, Estimate(MatchOptions(), 2));
  const DecimatedSize well = {kLarge, {4000, 8000}};
  const DecimatedSize badly = {kLarge, kLarge};
  EXPECT_THAT(CheckDecimated(well, well, options), IsOk());
  for (const auto& [x, y] : {std::pair(well, badly), std::pair(badly, well)}) {
    EXPECT_THAT(CheckDecimated(x, y, options),
                StatusIs(absl::StatusCode::kResourceExhausted,
                         HasSubstr("to 100000 only, not 4000")));
  }
  EXPECT_THAT(CheckDecimated(badly, badly, MatchOptions()), IsOk());
}

TEST(CheckDecimatedTest, WhatFitsOnceNeedNotFitTwice) {
  const DecimatedSize well = {{9000, 18000}, {4000, 8000}};
  const DecimatedSize badly = {{9000, 18000}, {9000, 18000}};
  MatchOptions options;
  options.memory_limit_bytes = std::numeric_limits<std::int64_t>::max();
  while (CheckDecimated(well, badly, options).ok()) {
    options.memory_limit_bytes -= options.memory_limit_bytes / 64;
  }
  options.memory_limit_bytes += options.memory_limit_bytes / 32;
  EXPECT_THAT(CheckDecimated(badly, well, options), IsOk());
  EXPECT_FALSE(CheckDecimated(badly, badly, options).ok());
}

TEST(CheckDecimatedTest, AMeshThatCannotBeDecimatedStaysWithinItsLimit) {
  const TriangleMesh mesh = AnyFaces(15'000);
  MatchOptions options;
  options.solved_vertices = 500;
  options.threads = 2;
  options.memory_limit_bytes =
      EstimateMemoryBytes(SizeOf(mesh), SizeOf(mesh), 0, options);
  EXPECT_THAT(Match(mesh, mesh, {}, options),
              StatusIs(absl::StatusCode::kResourceExhausted,
                       HasSubstr("can be decimated to 1")));
}

TEST(CheckDecimatedTest, PreparedShapesThatCouldNotBeDecimatedAreRefused) {
  MatchOptions options;
  options.solved_vertices = 600;
  const auto prepared = Prepare(AnyFaces(1200), options);
  ASSERT_THAT(prepared, IsOk());
  const MeshSize size = SizesOf(*prepared->contents().whole).mesh;
  options.memory_limit_bytes = EstimateMemoryBytes(size, size, 0, options);
  EXPECT_THAT(MatchPrepared(*prepared, *prepared, {}, options),
              StatusIs(absl::StatusCode::kResourceExhausted,
                       HasSubstr("only, not 600")));
}

TEST(CheckDecimatedTest, WithoutALimitAMeshThatCannotBeDecimatedIsPrepared) {
  MatchOptions options;
  options.solved_vertices = 500;
  const auto prepared = Prepare(AnyFaces(1000), options);
  ASSERT_THAT(prepared, IsOk());
  EXPECT_GT(prepared->contents().whole->solved().mesh.num_vertices(), 900);
}

class LimitedMatchTest : public testing::Test {
 protected:
  const TriangleMesh x_ = FiveArms(4);
  const TriangleMesh y_ = Moved(x_, 2);

  std::int64_t EstimateOf(int solved_vertices) const {
    MatchOptions options;
    options.threads = 1;
    options.solved_vertices = solved_vertices;
    return EstimateMemoryBytes(SizeOf(x_), SizeOf(y_), 0, options);
  }
};

TEST_F(LimitedMatchTest, StaysWithinItsLimitAndSaysSo) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "sanitizers change what a process allocates";
#endif
  MatchOptions options;
  options.memory_limit_bytes = EstimateOf(1500);
  ASSERT_LT(options.memory_limit_bytes, EstimateOf(4000));
  const MemoryGrowth growth;
  const auto result = Match(x_, y_, {}, options);
  const std::int64_t taken = growth.Bytes();
  ASSERT_THAT(result, IsOk());
  EXPECT_LE(taken, options.memory_limit_bytes);
  ASSERT_FALSE(result->warnings.empty());
  EXPECT_THAT(result->warnings[0], HasSubstr("solved on 1500 vertices"));
}

TEST_F(LimitedMatchTest, SameMapAtAnyThreadCount) {
  MatchOptions options;
  options.memory_limit_bytes = EstimateOf(1200);
  options.threads = 1;
  const auto one = Match(x_, y_, {}, options);
  options.threads = 4;
  const auto four = Match(x_, y_, {}, options);
  ASSERT_THAT(one, IsOk());
  ASSERT_THAT(four, IsOk());
  EXPECT_EQ(one->y_from_x, four->y_from_x);
}

TEST_F(LimitedMatchTest, RefusesBeforeItStarts) {
  MatchOptions options;
  options.memory_limit_bytes = 1'000'000;
  int reports = 0;
  EXPECT_THAT(Match(x_, y_, {}, options, {[&](const Progress&) { ++reports; }})
                  .status(),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("options.memory_limit_bytes: 1000000")));
  EXPECT_EQ(reports, 0);
}

}  // namespace
}  // namespace isomatch
