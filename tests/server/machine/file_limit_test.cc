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

}  // namespace
}  // namespace isomatch
