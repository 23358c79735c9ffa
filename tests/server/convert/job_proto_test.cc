#include "server/convert/job_proto.h"

#include <set>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/strings/ascii.h"
#include "absl/strings/str_replace.h"
#include "core/pipeline/progress.h"
#include "server/jobs/errors.h"
#include "tests/support/matchers.h"

namespace isomatch {
namespace {

using testing::HasSubstr;

v1::Stage StageOf(std::int32_t stage) {
  JobSnapshot snapshot;
  snapshot.record.progress.stage = stage;
  return ToProto(snapshot).progress().stage();
}

TEST(JobProtoTest, EveryStageHasItsOwnNumberWhateverTheOrderOfCore) {
  std::set<v1::Stage> seen;
  for (int stage = 0; stage < kNumStages; ++stage) seen.insert(StageOf(stage));
  EXPECT_EQ(seen.size(), kNumStages);
  EXPECT_EQ(seen.count(v1::STAGE_UNSPECIFIED), 0);
  EXPECT_EQ(StageOf(kNoStage), v1::STAGE_UNSPECIFIED);
  EXPECT_EQ(StageOf(static_cast<int>(Stage::kPrepare)), v1::STAGE_PREPARE);
  EXPECT_EQ(StageOf(static_cast<int>(Stage::kZoomOut)), v1::STAGE_ZOOMOUT);
  EXPECT_EQ(StageOf(static_cast<int>(Stage::kChoice)), v1::STAGE_CHOICE);
  EXPECT_EQ(StageOf(static_cast<int>(Stage::kAlignment)), v1::STAGE_ALIGNMENT);
  EXPECT_EQ(StageOf(static_cast<int>(Stage::kQuality)), v1::STAGE_QUALITY);
}

// What the command line shows, metrics and benchmarks count.
TEST(JobProtoTest, StagesOfCoreHaveTheNamesOfTheApi) {
  for (int stage = 0; stage < kNumStages; ++stage) {
    std::string name = StageName(static_cast<Stage>(stage));
    absl::AsciiStrToUpper(&name);
    EXPECT_EQ(v1::Stage_Name(StageOf(stage)),
              "STAGE_" + absl::StrReplaceAll(name, {{" ", "_"}}));
  }
}

TEST(JobProtoTest, StageTimesAreNumberedAsProgressIs) {
  JobSnapshot snapshot;
  snapshot.record.result.emplace().stage_times = {
      {static_cast<std::int32_t>(Stage::kAlignment), 2}};
  EXPECT_EQ(ToProto(snapshot).result().stage_times(0).stage(),
            v1::STAGE_ALIGNMENT);
}

TEST(JobProtoTest, UnspecifiedIsTheMapAndUnknownPartsAreRefused) {
  EXPECT_EQ(*ParseResultPart(v1::RESULT_PART_UNSPECIFIED, "part"),
            ResultPart::kMap);
  EXPECT_EQ(*ParseResultPart(v1::RESULT_PART_PRECISE_MAP, "part"),
            ResultPart::kPreciseMap);
  EXPECT_EQ(*ParseResultPart(v1::RESULT_PART_FUNCTIONAL_MAP, "part"),
            ResultPart::kFunctionalMap);
  for (const int unknown : {-1, 6}) {
    EXPECT_THAT(ParseResultPart(unknown, "part"),
                StatusIs(absl::StatusCode::kInvalidArgument,
                         HasSubstr("expected a ResultPart")));
  }
}

}  // namespace
}  // namespace isomatch
