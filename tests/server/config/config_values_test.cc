#include "server/config/config_values.h"

#include <cstdint>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/matchers.h"

namespace isomatch {
namespace {

TEST(ConfigValuesTest, SizesHaveUnitsOf1000AndOf1024) {
  const auto bytes = [](const char* text) {
    return ParseBytes(text).value_or(-1);
  };
  EXPECT_EQ(bytes("0"), 0);
  EXPECT_EQ(bytes("4096"), 4096);
  EXPECT_EQ(bytes("7B"), 7);
  EXPECT_EQ(bytes("2kB"), 2000);
  EXPECT_EQ(bytes("2k"), 2000);
  EXPECT_EQ(bytes("2KiB"), 2048);
  EXPECT_EQ(bytes("3 mib"), 3 << 20);
  EXPECT_EQ(bytes("2GB"), 2'000'000'000);
  EXPECT_EQ(bytes("1TiB"), std::int64_t{1} << 40);
}

TEST(ConfigValuesTest, WhatIsNoSizeIsRefused) {
  for (const char* text : {"", "x", "-1", "1.5GiB", "2 XB", "2iB", "GiB", "1KK",
                           "99999999999999999999", "9999999999TiB"}) {
    EXPECT_FALSE(ParseBytes(text).ok()) << text;
  }
}

TEST(ConfigValuesTest, WrittenSizesAreReadBack) {
  for (const std::int64_t bytes :
       {std::int64_t{0}, std::int64_t{1}, std::int64_t{1000},
        std::int64_t{4} << 20, (std::int64_t{1} << 40) + 1024,
        std::int64_t{1} << 50, std::numeric_limits<std::int64_t>::max()}) {
    EXPECT_EQ(*ParseBytes(FormatBytes(bytes)), bytes) << FormatBytes(bytes);
  }
  EXPECT_EQ(FormatBytes(std::int64_t{3} << 30), "3GiB");
}

TEST(ConfigValuesTest, TimesWithoutUnitAreSeconds) {
  EXPECT_EQ(*ParseDurationValue("7"), absl::Seconds(7));
  EXPECT_EQ(*ParseDurationValue("0.5"), absl::Milliseconds(500));
  EXPECT_EQ(*ParseDurationValue("1h30m"), absl::Minutes(90));
  EXPECT_FALSE(ParseDurationValue("soon").ok());
  EXPECT_FALSE(ParseDurationValue("").ok());
}

TEST(ConfigValuesTest, UrlsAreShownWithoutPasswords) {
  for (const char* url :
       {"postgresql://db", "postgresql://me@db:1/d", "postgres://[::1]:1/d?a=b",
        "postgresql://me@/d?host=/run/x&sslmode=require"}) {
    EXPECT_EQ(WithoutPassword(url), url);
  }
  for (const char* url :
       {"postgresql://me:secret@db:1/d", "postgresql://me:s/ecret@db:1/d",
        "postgresql://me:s@ecret@db:1/d", "postgresql://me:s:ecret@db:1/d",
        "postgresql://me:s?ecret@db:1/d",
        "postgresql://me@db:1/d?password=secret"}) {
    EXPECT_EQ(WithoutPassword(url), "postgresql://me@db:1/d") << url;
  }
  EXPECT_EQ(WithoutPassword("postgresql://me:s@db/d?a=b&password=s@ecret&c=d"),
            "postgresql://me@db/d?a=b&c=d");
  EXPECT_EQ(WithoutPassword("postgresql://db:1/d?user=m@e&password=secret"),
            "postgresql://db@e");
  EXPECT_EQ(WithoutPassword("host=db password=secret"), "");
}

TEST(ConfigValuesTest, ChecksNameFieldValueAndRange) {
  constexpr auto kInvalid = absl::StatusCode::kInvalidArgument;
  EXPECT_THAT(CheckCount("--a", 3, {1, 3}), IsOk());
  EXPECT_THAT(CheckCount("--a", 4, {1, 3}),
              StatusIs(kInvalid, "--a = 4, expected 1 to 3"));
  EXPECT_THAT(CheckBytes("--b", 1, {1024, 2048}),
              StatusIs(kInvalid, "--b = 1, expected 1KiB to 2KiB"));
  EXPECT_THAT(CheckDuration("--c", absl::Seconds(61),
                            {absl::Seconds(1), absl::Minutes(1)}),
              StatusIs(kInvalid, "--c = 1m1s, expected 1s to 1m"));
}

}  // namespace
}  // namespace isomatch
