#include "server/config/config_file.h"

#include <sstream>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/matchers.h"

namespace isomatch {
namespace {

absl::StatusOr<std::vector<ConfigEntry>> Read(const std::string& text) {
  std::istringstream file(text);
  return ReadConfigFile(file);
}

/// The value of the one line "key = `text`", or the error.
std::string Value(const std::string& text) {
  const auto entries = Read("key = " + text);
  if (!entries.ok()) return std::string(entries.status().message());
  return entries->at(0).value;
}

TEST(ConfigFileTest, ReadsKeysValuesAndLineNumbers) {
  const auto entries =
      Read("# comment\n\n  workers = 2\nlog-level=\"debug\"\n");
  ASSERT_THAT(entries, IsOk());
  ASSERT_EQ(entries->size(), 2);
  EXPECT_EQ(entries->at(0).key, "workers");
  EXPECT_EQ(entries->at(0).value, "2");
  EXPECT_EQ(entries->at(0).line, 3);
  EXPECT_EQ(entries->at(1).key, "log-level");
  EXPECT_EQ(entries->at(1).value, "debug");
}

TEST(ConfigFileTest, ValuesMayBeQuotedAndFollowedByAComment) {
  EXPECT_EQ(Value("true # comment"), "true");
  EXPECT_EQ(Value("-100 # comment"), "-100");
  EXPECT_EQ(Value("0.5"), "0.5");
  EXPECT_EQ(Value("1234567.5"), "1234567.5");
  EXPECT_EQ(Value("0x10"), "16");
  EXPECT_EQ(Value(R"("two words # and this" # comment)"),
            "two words # and this");
  EXPECT_EQ(Value(R"('a\b "c"')"), R"(a\b "c")");
  EXPECT_EQ(Value(R"("a\\b \"c\"")"), R"(a\b "c")");
  EXPECT_EQ(Value(R"("")"), "");
}

TEST(ConfigFileTest, QuotedValuesAreReadBack) {
  for (const char* text : {"", "a", "a b", "#", "'", "\"", "\\", "\\\"'#= ü",
                           "\n\t", "\r\x01\x7f"}) {
    EXPECT_EQ(Value(QuoteConfigValue(text)), text);
  }
}

TEST(ConfigFileTest, WrongLinesAreRefusedWithTheirNumber) {
  for (const char* line :
       {"workers", "[network]", "= 2", "workers =", "workers = 2 3",
        "workers = \"2", "workers = \"2\" 3", "workers = [2]", "wor kers = 2",
        "w = 'a", "w = \"\\", "w = word", "w = 30s", "w = 2026-11-24",
        "w.x = 2"}) {
    EXPECT_THAT(Read(std::string("a = 1\n") + line),
                StatusIs(absl::StatusCode::kInvalidArgument,
                         testing::StartsWith("line 2: ")))
        << line;
  }
}

TEST(ConfigFileTest, AKeyComesOnce) {
  EXPECT_THAT(Read("workers = 1\nworkers = 1\n"),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       testing::StartsWith("line 2: ")));
}

}  // namespace
}  // namespace isomatch
