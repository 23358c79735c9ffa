#include "core/pipeline/instruction_set.h"

#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "core/pipeline/matcher.h"
#include "tests/support/matchers.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

/// Leaves things as they were.
class InstructionSetTest : public testing::Test {
 protected:
  ~InstructionSetTest() override {
    EXPECT_THAT(UseInstructionSet(before_), IsOk());
  }

  const std::string before_ = InstructionSet();
};

TEST_F(InstructionSetTest, TheBestOneIsUsed) {
  ASSERT_FALSE(InstructionSets().empty());
  EXPECT_EQ(InstructionSet(), InstructionSets().front());
}

TEST_F(InstructionSetTest, UnknownOnesAreRefusedAndChangeNothing) {
  EXPECT_THAT(UseInstructionSet("mmx"),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       testing::HasSubstr("'mmx', expected one of ")));
  EXPECT_EQ(InstructionSet(), before_);
}

TEST_F(InstructionSetTest, AllFindTheTruth) {
  const TriangleMesh x = FiveArms(4);
  const TriangleMesh y = Moved(x, 2);
  for (const std::string& name : InstructionSets()) {
    SCOPED_TRACE(name);
    ASSERT_THAT(UseInstructionSet(name), IsOk());
    EXPECT_EQ(InstructionSet(), name);
    const auto result = Match(x, y, {}, {});
    ASSERT_THAT(result, IsOk());
    EXPECT_GT(FractionRight(result->y_from_x, IdentityMap(x.num_vertices())),
              0.98);
  }
}

TEST_F(InstructionSetTest, PreparedShapesSurviveASwitch) {
  const TriangleMesh x = FiveArms(3);
  const TriangleMesh y = Moved(x, 2);
  const auto prepared_x = Prepare(x, {});
  const auto prepared_y = Prepare(y, {});
  ASSERT_THAT(prepared_x, IsOk());
  ASSERT_THAT(prepared_y, IsOk());
  ASSERT_THAT(UseInstructionSet(InstructionSets().back()), IsOk());
  const auto result = MatchPrepared(*prepared_x, *prepared_y, {}, {});
  ASSERT_THAT(result, IsOk());
  EXPECT_GT(FractionRight(result->y_from_x, IdentityMap(x.num_vertices())),
            0.98);
}

}  // namespace
}  // namespace isomatch
