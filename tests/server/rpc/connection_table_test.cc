#include "server/rpc/connection_table.h"

#include <string>
#include <vector>

#include <arpa/inet.h>
#include <fcntl.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include "core/base/file_descriptor.h"

namespace isomatch {
namespace {

using Admission = ConnectionTable::Admission;

FileDescriptor NewSocket() {
  return FileDescriptor(socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
}

sockaddr_storage Peer(const std::string& text) {
  sockaddr_storage peer{};
  auto& ipv4 = reinterpret_cast<sockaddr_in&>(peer);
  auto& ipv6 = reinterpret_cast<sockaddr_in6&>(peer);
  if (inet_pton(AF_INET, text.c_str(), &ipv4.sin_addr) == 1) {
    peer.ss_family = AF_INET;
  } else if (inet_pton(AF_INET6, text.c_str(), &ipv6.sin6_addr) == 1) {
    peer.ss_family = AF_INET6;
  } else {
    peer.ss_family = AF_UNIX;
  }
  return peer;
}

TEST(OriginOfTest, ThisMachineHasNone) {
  for (const char* peer :
       {"127.0.0.1", "127.8.9.10", "::1", "::ffff:127.0.0.1", "unix"}) {
    EXPECT_EQ(OriginOf(Peer(peer)), "") << peer;
  }
}

TEST(OriginOfTest, IsTheAddressOrTheNetworkOfIpv6) {
  const auto is_one = [](const char* one, const char* other) {
    return OriginOf(Peer(one)) == OriginOf(Peer(other));
  };
  EXPECT_NE(OriginOf(Peer("192.0.2.1")), "");
  EXPECT_TRUE(is_one("192.0.2.1", "192.0.2.1"));
  EXPECT_FALSE(is_one("192.0.2.1", "192.0.2.2"));
  EXPECT_TRUE(is_one("192.0.2.1", "::ffff:192.0.2.1"));
  EXPECT_TRUE(is_one("2001:db8:0:1::5", "2001:db8:0:1:ff::6"));
  EXPECT_FALSE(is_one("2001:db8:0:1::5", "2001:db8:0:2::5"));
}

class ConnectionTableTest : public testing::Test {
 protected:
  // Each later than a pause between two looks at all connections.
  Admission Admit(const FileDescriptor& socket, const std::string& origin) {
    now_ += std::chrono::seconds(1);
    return table_.Admit(socket.get(), origin, now_);
  }

  ConnectionTable::Clock::time_point now_;
  ConnectionTable table_{{.most = 4, .of_one_address = 2}};
};

TEST_F(ConnectionTableTest, MoreThanTheMostAreRefused) {
  std::vector<FileDescriptor> sockets;
  for (int i = 0; i < 4; ++i) {
    sockets.push_back(NewSocket());
    EXPECT_EQ(Admit(sockets.back(), ""), Admission::kAdmitted);
  }
  EXPECT_EQ(table_.CountOpen(), 4);
  const FileDescriptor another = NewSocket();
  EXPECT_EQ(Admit(another, ""), Admission::kTooMany);
  sockets[1].Close();
  EXPECT_EQ(Admit(another, ""), Admission::kAdmitted);
  EXPECT_EQ(table_.CountOpen(), 4);
}

TEST_F(ConnectionTableTest, OneAddressDoesNotTakeTheConnectionsOfOthers) {
  const FileDescriptor one = NewSocket();
  FileDescriptor two = NewSocket();
  const FileDescriptor three = NewSocket();
  EXPECT_EQ(Admit(one, "a"), Admission::kAdmitted);
  EXPECT_EQ(Admit(two, "a"), Admission::kAdmitted);
  EXPECT_EQ(Admit(three, "a"), Admission::kTooManyOfOrigin);
  EXPECT_EQ(Admit(three, "b"), Admission::kAdmitted);
  two.Close();
  const FileDescriptor four = NewSocket();
  EXPECT_EQ(Admit(four, "a"), Admission::kAdmitted);
}

// gRPC closes a socket, and a store opens a file, which gets its number.
TEST_F(ConnectionTableTest, ANumberThatIsAnotherFileNowIsNoConnection) {
  FileDescriptor socket = NewSocket();
  EXPECT_EQ(Admit(socket, "a"), Admission::kAdmitted);
  const int number = socket.get();
  const FileDescriptor file(open("/dev/null", O_RDONLY | O_CLOEXEC));
  ASSERT_EQ(dup2(file.get(), number), number);
  EXPECT_EQ(table_.CountOpen(), 0);
  const FileDescriptor other = NewSocket();
  ASSERT_EQ(dup2(other.get(), number), number);
  EXPECT_EQ(Admit(socket, "b"), Admission::kAdmitted);
  EXPECT_EQ(table_.CountOpen(), 1);
}

// The same number again and again, as the system gives the lowest one.
TEST_F(ConnectionTableTest, ConnectionsThatEndedAreNotCountedTwice) {
  for (int i = 0; i < 20; ++i) {
    const FileDescriptor socket = NewSocket();
    EXPECT_EQ(Admit(socket, "a"), Admission::kAdmitted);
  }
  EXPECT_EQ(table_.CountOpen(), 0);
}

TEST_F(ConnectionTableTest, AFloodOfRefusedOnesDoesNotMakeItLookAtAllEachTime) {
  FileDescriptor one = NewSocket();
  const FileDescriptor two = NewSocket();
  const FileDescriptor three = NewSocket();
  EXPECT_EQ(Admit(one, "a"), Admission::kAdmitted);
  EXPECT_EQ(Admit(two, "a"), Admission::kAdmitted);
  EXPECT_EQ(Admit(three, "a"), Admission::kTooManyOfOrigin);
  one.Close();
  now_ += std::chrono::milliseconds(19);
  EXPECT_EQ(table_.Admit(three.get(), "a", now_), Admission::kTooManyOfOrigin);
  now_ += std::chrono::milliseconds(2);
  EXPECT_EQ(table_.Admit(three.get(), "a", now_), Admission::kAdmitted);
}

}  // namespace
}  // namespace isomatch
