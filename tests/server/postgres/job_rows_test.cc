#include "server/postgres/job_rows.h"

#include <string>

#include <gtest/gtest.h>

namespace isomatch {
namespace {

TEST(JobRowsTest, NoTextEndsAnArrayOrAddsToIt) {
  EXPECT_EQ(ArrayOf({}), "{}");
  EXPECT_EQ(ArrayOf({"a", R"(b"},\c)"}), R"({"a","b\"},\\c"})");
  // libpq sends what comes before a zero.
  const std::string array = ArrayOf({std::string("a\0b", 3), "c"});
  EXPECT_EQ(array.c_str(), array);
}

}  // namespace
}  // namespace isomatch
