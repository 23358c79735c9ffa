#include "server/rpc/listening_sockets.h"

#include <cstring>
#include <filesystem>
#include <string>

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/un.h>

#include "absl/strings/str_cat.h"
#include "tests/support/matchers.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::MatchesRegex;

std::string PortOf(const ListeningSockets& sockets) {
  const std::string& address = sockets.address();
  return address.substr(address.rfind(':') + 1);
}

bool Connects(int family, const sockaddr* address, socklen_t size) {
  const FileDescriptor client(socket(family, SOCK_STREAM | SOCK_CLOEXEC, 0));
  return connect(client.get(), address, size) == 0;
}

bool ConnectsIpv4(const std::string& port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  address.sin_port = htons(static_cast<std::uint16_t>(std::stoi(port)));
  return Connects(AF_INET, reinterpret_cast<const sockaddr*>(&address),
                  sizeof(address));
}

bool ConnectsIpv6(const std::string& port) {
  sockaddr_in6 address{};
  address.sin6_family = AF_INET6;
  address.sin6_addr = IN6ADDR_LOOPBACK_INIT;
  address.sin6_port = htons(static_cast<std::uint16_t>(std::stoi(port)));
  return Connects(AF_INET6, reinterpret_cast<const sockaddr*>(&address),
                  sizeof(address));
}

bool ConnectsUnix(const std::string& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::strncpy(address.sun_path, path.c_str(), sizeof(address.sun_path) - 1);
  return Connects(AF_UNIX, reinterpret_cast<const sockaddr*>(&address),
                  sizeof(address));
}

bool HasIpv6() { return ListeningSockets::Open("[::1]:0").ok(); }

TEST(ListeningSocketsTest, PortZeroIsAFreeOne) {
  const auto sockets = ListeningSockets::Open("127.0.0.1:0");
  ASSERT_TRUE(sockets.ok()) << sockets.status();
  EXPECT_THAT(sockets->address(), MatchesRegex("127.0.0.1:[1-9][0-9]*"));
  EXPECT_TRUE(ConnectsIpv4(PortOf(*sockets)));
}

TEST(ListeningSocketsTest, ANameStandsForAllItsAddresses) {
  const auto sockets = ListeningSockets::Open("localhost:0");
  ASSERT_TRUE(sockets.ok()) << sockets.status();
  EXPECT_THAT(sockets->address(), MatchesRegex("localhost:[1-9][0-9]*"));
  EXPECT_TRUE(ConnectsIpv4(PortOf(*sockets)));
}

TEST(ListeningSocketsTest, AllAddressesAreThoseOfIpv6Too) {
  for (const std::string host : {"0.0.0.0", "[::]"}) {
    const auto sockets = ListeningSockets::Open(host + ":0");
    ASSERT_TRUE(sockets.ok()) << sockets.status();
    EXPECT_EQ(sockets->address(), absl::StrCat(host, ":", PortOf(*sockets)));
    EXPECT_TRUE(ConnectsIpv4(PortOf(*sockets))) << host;
    EXPECT_EQ(ConnectsIpv6(PortOf(*sockets)), HasIpv6()) << host;
  }
}

TEST(ListeningSocketsTest, AnAddressOfIpv6IsNotOneOfIpv4) {
  if (!HasIpv6()) GTEST_SKIP() << "this machine has no IPv6";
  const auto sockets = ListeningSockets::Open("[::1]:0");
  ASSERT_TRUE(sockets.ok()) << sockets.status();
  EXPECT_TRUE(ConnectsIpv6(PortOf(*sockets)));
  EXPECT_FALSE(ConnectsIpv4(PortOf(*sockets)));
}

TEST(ListeningSocketsTest, APortInUseIsRefused) {
  const auto first = ListeningSockets::Open("127.0.0.1:0");
  ASSERT_TRUE(first.ok()) << first.status();
  for (const std::string host : {"127.0.0.1:", "0.0.0.0:", "localhost:"}) {
    EXPECT_THAT(ListeningSockets::Open(host + PortOf(*first)),
                StatusIs(absl::StatusCode::kUnavailable,
                         AllOf(HasSubstr("cannot listen on " + host),
                               HasSubstr("in use"))));
  }
}

TEST(ListeningSocketsTest, AnAddressOfAnotherMachineIsRefused) {
  EXPECT_THAT(ListeningSockets::Open("192.0.2.1:0"),
              StatusIs(absl::StatusCode::kUnavailable,
                       HasSubstr("cannot listen on 192.0.2.1:0")));
}

class UnixSocketTest : public testing::Test {
 protected:
  const TemporaryFolder folder_;
  const std::string path_ = folder_.Path("socket");
  const std::string address_ = "unix:" + path_;
};

TEST_F(UnixSocketTest, IsAFileThatGoesWithTheListener) {
  {
    const auto sockets = ListeningSockets::Open(address_);
    ASSERT_TRUE(sockets.ok()) << sockets.status();
    EXPECT_EQ(sockets->address(), address_);
    EXPECT_TRUE(ConnectsUnix(path_));
  }
  EXPECT_FALSE(std::filesystem::exists(path_));
}

TEST_F(UnixSocketTest, MayBeWrittenAsAUrl) {
  const auto sockets = ListeningSockets::Open("unix://" + path_);
  ASSERT_TRUE(sockets.ok()) << sockets.status();
  EXPECT_TRUE(ConnectsUnix(path_));
}

TEST_F(UnixSocketTest, OfAServerThatWasKilledGivesWay) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::strncpy(address.sun_path, path_.c_str(), sizeof(address.sun_path) - 1);
  FileDescriptor killed(socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
  ASSERT_EQ(bind(killed.get(), reinterpret_cast<sockaddr*>(&address),
                 sizeof(address)),
            0);
  killed.Close();
  ASSERT_TRUE(std::filesystem::exists(path_));
  EXPECT_TRUE(ListeningSockets::Open(address_).ok());
}

TEST_F(UnixSocketTest, OfAServerThatRunsDoesNot) {
  const auto first = ListeningSockets::Open(address_);
  ASSERT_TRUE(first.ok()) << first.status();
  EXPECT_THAT(ListeningSockets::Open(address_),
              StatusIs(absl::StatusCode::kUnavailable, HasSubstr("in use")));
  EXPECT_TRUE(ConnectsUnix(path_));
}

TEST_F(UnixSocketTest, NeverReplacesAFile) {
  folder_.Write("socket", "a file");
  EXPECT_FALSE(ListeningSockets::Open(address_).ok());
  EXPECT_TRUE(std::filesystem::is_regular_file(path_));
}

TEST_F(UnixSocketTest, HasAPathOfAtMost107Bytes) {
  EXPECT_THAT(ListeningSockets::Open(address_ + std::string(108, 'x')),
              StatusIs(absl::StatusCode::kUnavailable, HasSubstr("107 bytes")));
  EXPECT_FALSE(ListeningSockets::Open("unix:").ok());
}

}  // namespace
}  // namespace isomatch
