#include "server/convert/job_proto.h"

#include <cstdint>
#include <iterator>
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

v1::Job WithStage(std::int32_t stage) {
  JobSnapshot snapshot;
  snapshot.record.progress.stage = stage;
  snapshot.record.result.emplace().stage_times = {{stage, 2}};
  return ToProto(snapshot);
}

// What the command line shows, metrics and benchmarks count.
TEST(JobProtoTest, StagesOfCoreHaveTheNumbersAndNamesOfTheApi) {
  EXPECT_EQ(v1::Stage_MAX, std::size(kStages));
  for (const Stage stage : kStages) {
    std::string name = StageName(stage);
    absl::AsciiStrToUpper(&name);
    name = "STAGE_" + absl::StrReplaceAll(name, {{" ", "_"}});
    const v1::Job job = WithStage(static_cast<std::int32_t>(stage));
    EXPECT_EQ(v1::Stage_Name(job.progress().stage()), name);
    EXPECT_EQ(v1::Stage_Name(job.result().stage_times(0).stage()), name);
  }
  EXPECT_EQ(WithStage(kNoStage).progress().stage(), v1::STAGE_UNSPECIFIED);
}

TEST(JobProtoTest, UnspecifiedIsTheMapAndUnknownPartsAreRefused) {
  EXPECT_EQ(*ParseResultPart(v1::RESULT_PART_UNSPECIFIED, "part"),
            ResultPart::kMap);
  EXPECT_EQ(*ParseResultPart(v1::RESULT_PART_PRECISE_MAP, "part"),
            ResultPart::kPreciseMap);
  EXPECT_EQ(*ParseResultPart(v1::RESULT_PART_FUNCTIONAL_MAP, "part"),
            ResultPart::kFunctionalMap);
  EXPECT_EQ(*ParseResultPart(v1::RESULT_PART_MASK_Y, "part"),
            ResultPart::kMaskY);
  for (const int unknown : {-1, 7}) {
    EXPECT_THAT(ParseResultPart(unknown, "part"),
                StatusIs(absl::StatusCode::kInvalidArgument,
                         HasSubstr("expected a ResultPart")));
  }
}

}  // namespace
}  // namespace isomatch
