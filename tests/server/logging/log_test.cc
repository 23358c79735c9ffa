#include "server/logging/log.h"

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <spdlog/spdlog.h>

#include "tests/server/logging/captured_log.h"

namespace isomatch {
namespace {

using testing::EndsWith;
using testing::MatchesRegex;

TEST(LogTest, JsonHasTimeLevelMessageAndFields) {
  const CapturedLog log(LogFormat::kJson);
  Log(LogLevel::kInfo, "it happened",
      {{"job", "a"}, {"seconds", 0.5}, {"bytes", std::int64_t{7}}});
  const auto lines = log.lines();
  ASSERT_EQ(lines.size(), 1);
  EXPECT_EQ(lines[0]["level"], "info");
  EXPECT_EQ(lines[0]["message"], "it happened");
  EXPECT_EQ(lines[0]["job"], "a");
  EXPECT_EQ(lines[0]["seconds"], 0.5);
  EXPECT_EQ(lines[0]["bytes"], 7);
  EXPECT_THAT(lines[0]["time"].get<std::string>(),
              MatchesRegex("[0-9]{4}-[0-9]{2}-[0-9]{2}T[0-9]{2}:[0-9]{2}:"
                           "[0-9]{2}\\.[0-9]{3}Z"));
}

TEST(LogTest, TextHasTheMessageWithoutTheFields) {
  const CapturedLog log(LogFormat::kText);
  Log(LogLevel::kWarning, "it happened", {{"job", "a"}});
  EXPECT_THAT(log.text(), EndsWith(" warning it happened\n"));
}

TEST(LogTest, AnyBytesMakeOneValidLine) {
  std::string bytes;
  for (int i = 0; i < 256; ++i) bytes += static_cast<char>(i);
  {
    const CapturedLog log(LogFormat::kJson);
    Log(LogLevel::kInfo, bytes, {{"peer", bytes}});
    EXPECT_EQ(log.lines().size(), 1);
  }
  const CapturedLog log(LogFormat::kText);
  Log(LogLevel::kInfo, "a\nb", {});
  EXPECT_THAT(log.text(), EndsWith("a b\n"));
}

TEST(LogTest, LowerLevelsAreLeftOut) {
  const CapturedLog log(LogFormat::kJson, spdlog::level::warn);
  EXPECT_FALSE(ShouldLog(LogLevel::kInfo));
  EXPECT_TRUE(ShouldLog(LogLevel::kError));
  Log(LogLevel::kInfo, "quiet");
  EXPECT_EQ(log.text(), "");
}

}  // namespace
}  // namespace isomatch
