#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <jemalloc/jemalloc.h>

#include <cstddef>
#include <cstdint>
#include <vector>

#include "server/machine/process_memory.h"
#include "tests/server/child_process.h"

namespace isomatch {
namespace {

using ::testing::AnyOf;
using ::testing::Contains;
using ::testing::EndsWith;
using ::testing::StrEq;

constexpr std::int64_t kMebibyte = 1 << 20;

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
    ChildProcess process(
        "/usr/bin/env", {"MALLOC_CONF=stats_print:true", program, "--version"});
    EXPECT_THAT(process.ReadLines(), Contains(EndsWith("opt.narenas: 1")))
        << program;
    EXPECT_EQ(process.ExitStatus(), 0) << program;
  }
}

}  // namespace
}  // namespace isomatch
