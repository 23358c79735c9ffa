#include "core/base/host_port.h"

#include <gtest/gtest.h>

namespace isomatch {
namespace {

TEST(HostPortTest, HasBothParts) {
  const auto name = ParseHostPort("example.org:7443");
  ASSERT_TRUE(name.has_value());
  EXPECT_EQ(name->host, "example.org");
  EXPECT_EQ(name->port, 7443);
  const auto six = ParseHostPort("[::1]:0");
  ASSERT_TRUE(six.has_value());
  EXPECT_EQ(six->host, "[::1]");
  EXPECT_EQ(six->port, 0);
}

TEST(HostPortTest, AnythingElseIsNone) {
  for (const char* text : {"", ":", ":80", "localhost", "localhost:",
                           "localhost:x", "localhost:-1", "localhost:65536"}) {
    EXPECT_FALSE(ParseHostPort(text).has_value()) << text;
  }
}

TEST(HostPortTest, NamesThatBeginAsLoopbackAreOtherMachines) {
  for (const char* here : {"127.0.0.1:1", "127.1.2.3:80", "localhost:7443",
                           "[::1]:65535", "unix:/tmp/socket"}) {
    EXPECT_TRUE(IsLoopbackAddress(here)) << here;
  }
  for (const char* other :
       {"127.evil.example:1", "127.0.0.1.example.org:80", "localhost.org:80",
        "[::2]:80", "0.0.0.0:80", "example.org:80"}) {
    EXPECT_FALSE(IsLoopbackAddress(other)) << other;
  }
}

}  // namespace
}  // namespace isomatch
