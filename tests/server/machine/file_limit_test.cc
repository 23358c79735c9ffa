#include "server/machine/file_limit.h"

#include <algorithm>

#include <gtest/gtest.h>
#include <sys/resource.h>

namespace isomatch {
namespace {

TEST(FileLimitTest, IsRaisedToWhatTheProcessMayHave) {
  rlimit before{};
  ASSERT_EQ(getrlimit(RLIMIT_NOFILE, &before), 0);
  rlimit low = before;
  low.rlim_cur = 128;
  ASSERT_EQ(setrlimit(RLIMIT_NOFILE, &low), 0);
  EXPECT_EQ(FileLimit(), 128);
  RaiseFileLimit();
  const auto most = std::min<rlim_t>(before.rlim_max, 1 << 20);
  EXPECT_EQ(FileLimit(), static_cast<std::int64_t>(most));
  EXPECT_EQ(setrlimit(RLIMIT_NOFILE, &before), 0);
}

TEST(ConnectionLimitsTest, LeaveAQuarterOfFewFilesAnd1024OfMany) {
  EXPECT_EQ(ChooseConnectionLimits(0, 0, 256).most, 192);
  EXPECT_EQ(ChooseConnectionLimits(0, 0, 1024).most, 768);
  EXPECT_EQ(ChooseConnectionLimits(0, 0, 1 << 20).most, 10'000);
  EXPECT_EQ(ChooseConnectionLimits(1'000'000, 0, 1 << 20).most, 1'000'000);
  EXPECT_EQ(ChooseConnectionLimits(1'000'000, 0, 20'000).most, 18'976);
  EXPECT_EQ(ChooseConnectionLimits(50, 0, 1024).most, 50);
  EXPECT_EQ(ChooseConnectionLimits(0, 0, 1).most, 1);
}

TEST(ConnectionLimitsTest, OneAddressGetsAnEighth) {
  EXPECT_EQ(ChooseConnectionLimits(0, 0, 1 << 20).of_one_address, 1250);
  EXPECT_EQ(ChooseConnectionLimits(2, 0, 1 << 20).of_one_address, 1);
  EXPECT_EQ(ChooseConnectionLimits(0, 7, 1 << 20).of_one_address, 7);
}

}  // namespace
}  // namespace isomatch
