#include "core/base/lanes.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <gtest/gtest.h>

namespace isomatch {
namespace {

constexpr Lanes kSome = {3, -1, 0.5f, 7, -2.5f, 0, 1e-3f, 4};
constexpr Lanes kOthers = {-3, 2, 0.25f, 7, -8, 1, 1e3f, -4};

TEST(LanesTest, EachLaneIsComputedAsOneValueIs) {
  for (int lane = 0; lane < kLanes; ++lane) {
    const float a = kSome[lane];
    const float b = kOthers[lane];
    EXPECT_EQ(MinLanes(kSome, kOthers)[lane], std::min(a, b));
    EXPECT_EQ(MaxLanes(kSome, kOthers)[lane], std::max(a, b));
    EXPECT_EQ(AbsLanes(kSome)[lane], std::abs(a));
    EXPECT_EQ(SqrtLanes(AbsLanes(kSome))[lane], std::sqrt(std::abs(a)));
    EXPECT_EQ(AllLanes(b)[lane], kOthers[lane]);
    EXPECT_EQ(DotLanes({kSome, kOthers, kSome}, {kOthers, kSome, kSome})[lane],
              a * b + b * a + a * a);
  }
}

TEST(LanesTest, NoNumberIsNeitherLeastNorLargest) {
  const Lanes none = AllLanes(std::numeric_limits<float>::quiet_NaN());
  EXPECT_EQ(MinLanes(kSome, none)[3], kSome[3]);
  EXPECT_EQ(MaxLanes(kSome, none)[3], kSome[3]);
}

TEST(LanesTest, TheSumIsOfAll) {
  EXPECT_FLOAT_EQ(SumOfLanes(kSome), 11.001f);
  EXPECT_EQ(SumOfLanes(AllLanes(0.1f)), 0.8f);
}

TEST(LanesTest, AnyOfThemIsSeen) {
  EXPECT_FALSE(AnyLane(kSome > AllLanes(7)));
  for (int lane = 0; lane < kLanes; ++lane) {
    Lanes one = {};
    one[lane] = 1;
    EXPECT_TRUE(AnyLane(one > AllLanes(0))) << lane;
  }
}

TEST(LanesTest, AreReadFromAnywhereAndWrittenBack) {
  float values[2 * kLanes + 1];
  for (int i = 0; i <= 2 * kLanes; ++i) values[i] = static_cast<float>(i);
  const int places[kLanes] = {16, 0, 3, 3, 9, 12, 1, 2};
  const Lanes gathered = GatherLanes(values, places);
  StoreLanes(LoadLanes(values + 1), values + kLanes + 1);
  for (int lane = 0; lane < kLanes; ++lane) {
    EXPECT_EQ(gathered[lane], static_cast<float>(places[lane]));
    EXPECT_EQ(values[kLanes + 1 + lane], static_cast<float>(lane + 1));
  }
}

}  // namespace
}  // namespace isomatch
