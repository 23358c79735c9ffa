#include "server/rpc/security/memory_file.h"

#include <fstream>
#include <iterator>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/matchers.h"

namespace isomatch {
namespace {

std::string ReadWhole(std::istream& file) {
  return {std::istreambuf_iterator<char>(file), {}};
}

TEST(MemoryFileTest, WhoOpensItGetsAllOfTheOldOrAllOfTheNew) {
  MemoryFile file;
  ASSERT_THAT(file.Replace("a long content"), IsOk());
  const std::string path = file.path();
  std::ifstream before(path);
  ASSERT_THAT(file.Replace("new"), IsOk());
  EXPECT_EQ(file.path(), path);
  std::ifstream after(path);
  EXPECT_EQ(ReadWhole(before), "a long content");
  EXPECT_EQ(ReadWhole(after), "new");
  std::ifstream again(path);  // each reader begins at the beginning
  EXPECT_EQ(ReadWhole(again), "new");
}

TEST(MemoryFileTest, ItsNumberIsGivenBack) {
  std::string path;
  for (int i = 0; i < 3; ++i) {
    MemoryFile file;
    ASSERT_THAT(file.Replace("x"), IsOk());
    ASSERT_THAT(file.Replace("y"), IsOk());
    if (path.empty()) path = file.path();
    EXPECT_EQ(file.path(), path);
  }
}

}  // namespace
}  // namespace isomatch
