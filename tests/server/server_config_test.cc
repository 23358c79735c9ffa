#include "server/server_config.h"

#include <optional>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/server_flags.h"
#include "tests/support/matchers.h"

namespace isomatch {
namespace {

using testing::AllOf;
using testing::HasSubstr;

constexpr auto kInvalid = absl::StatusCode::kInvalidArgument;

TEST(ServerConfigTest, TheDefaultsAreValid) {
  EXPECT_THAT(ServerConfig().Validate(), IsOk());
}

TEST(ServerConfigTest, NamesFieldValueAndRange) {
  ServerConfig config;
  config.workers = 0;
  EXPECT_THAT(config.Validate(),
              StatusIs(kInvalid, HasSubstr("--workers = 0, expected 1 to")));
}

TEST(ServerConfigTest, ListensBeyondThisMachineOnlyWhenTold) {
  ServerConfig config;
  config.listen = "0.0.0.0:7443";
  EXPECT_THAT(config.Validate(), StatusIs(kInvalid, HasSubstr("--insecure")));
  config.insecure = true;
  EXPECT_THAT(config.Validate(), IsOk());
}

TEST(ServerConfigTest, KnowsLoopbackAddresses) {
  ServerConfig config;
  for (const char* listen :
       {"127.0.0.1:0", "localhost:80", "[::1]:65535", "unix:/tmp/s", ""}) {
    config.listen = listen;
    EXPECT_THAT(config.Validate(), IsOk()) << listen;
  }
  for (const char* listen : {"127.0.0.1", ":80", "localhost:65536",
                             "localhost:x", "example.org:80"}) {
    config.listen = listen;
    EXPECT_FALSE(config.Validate().ok()) << listen;
  }
}

std::optional<int> Parse(std::vector<const char*> flags, ServerConfig& config) {
  flags.insert(flags.begin(), "isomatch-server");
  return ParseServerFlags(static_cast<int>(flags.size()), flags.data(), config);
}

TEST(ServerFlagsTest, AreReadWithTheirUnits) {
  ServerConfig config;
  EXPECT_EQ(Parse({"--memory-budget", "2GiB", "--drain-timeout", "5m",
                   "--workers", "3", "--max-request-bytes", "8MiB"},
                  config),
            std::nullopt);
  EXPECT_EQ(config.memory_budget_bytes, std::int64_t{2} << 30);
  EXPECT_EQ(config.drain_timeout, absl::Minutes(5));
  EXPECT_EQ(config.workers, 3);
  EXPECT_EQ(config.max_request_bytes, 8 << 20);
}

TEST(ServerFlagsTest, ANumberWithoutUnitIsSeconds) {
  ServerConfig config;
  EXPECT_EQ(Parse({"--drain-timeout", "7"}, config), std::nullopt);
  EXPECT_EQ(config.drain_timeout, absl::Seconds(7));
}

TEST(ServerFlagsTest, WrongOnesEndWithStatusTwo) {
  for (const std::vector<const char*>& flags :
       std::vector<std::vector<const char*>>{{"--wrong"},
                                             {"--workers", "0"},
                                             {"--workers", "x"},
                                             {"--drain-timeout", "soon"},
                                             {"--log-level", "loud"},
                                             {"--listen", "0.0.0.0:1"}}) {
    ServerConfig config;
    EXPECT_EQ(Parse(flags, config), 2) << flags[0];
  }
}

TEST(ServerFlagsTest, HelpAndVersionEndWithStatusZero) {
  ServerConfig config;
  testing::internal::CaptureStdout();
  EXPECT_EQ(Parse({"--help"}, config), 0);
  EXPECT_THAT(testing::internal::GetCapturedStdout(),
              AllOf(HasSubstr("--listen"), HasSubstr("127.0.0.1:7443"),
                    HasSubstr("Examples")));
  testing::internal::CaptureStdout();
  EXPECT_EQ(Parse({"--version"}, config), 0);
  EXPECT_THAT(testing::internal::GetCapturedStdout(),
              HasSubstr("isomatch-server"));
}

}  // namespace
}  // namespace isomatch
