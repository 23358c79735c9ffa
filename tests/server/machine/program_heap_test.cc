#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <jemalloc/jemalloc.h>

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <string>
#include <vector>

#include "server/machine/process_memory.h"

namespace isomatch {
namespace {

using ::testing::AnyOf;
using ::testing::HasSubstr;
using ::testing::StrEq;

constexpr std::int64_t kMebibyte = 1 << 20;

/// What a command writes to standard output and standard error.
std::string OutputOf(const std::string& command) {
  std::FILE* const pipe = popen((command + " 2>&1").c_str(), "r");
  std::string output;
  for (int letter = 0; (letter = std::fgetc(pipe)) != EOF;) {
    output += static_cast<char>(letter);
  }
  EXPECT_EQ(pclose(pipe), 0) << output;
  return output;
}

TEST(ProgramHeapTest, LiesInHugePagesWhereTheSystemHasThem) {
  const char* pages = nullptr;
  std::size_t length = sizeof(pages);
  ASSERT_EQ(mallctl("opt.thp", &pages, &length, nullptr, 0), 0);
  EXPECT_THAT(pages, AnyOf(StrEq("always"), StrEq("not supported")));
}

TEST(ProgramHeapTest, FreedMemoryIsKeptUntilItIsReleased) {
  constexpr std::int64_t kBlocks = 64;
  const std::int64_t before = ResidentBytes();
  {
    std::vector<std::vector<char>> blocks(kBlocks);
    for (auto& block : blocks) block.assign(kMebibyte, 'x');
  }
  EXPECT_GT(ResidentBytes() - before, kBlocks / 2 * kMebibyte);
  ReleaseFreedMemory();
  EXPECT_LT(ResidentBytes() - before, kBlocks / 8 * kMebibyte);
}

TEST(ProgramHeapTest, IsThatOfThePrograms) {
  for (const char* program : {ISOMATCH_CLIENT_BINARY, ISOMATCH_SERVER_BINARY}) {
    const std::string output = OutputOf(
        std::string("MALLOC_CONF=stats_print:true ") + program + " --version");
    EXPECT_THAT(output, HasSubstr("isomatch")) << program;
    EXPECT_THAT(output, HasSubstr("opt.narenas: 1\n")) << program;
  }
}

}  // namespace
}  // namespace isomatch
