#include "server/rpc/accept_loop.h"

#include <cstring>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include <arpa/inet.h>
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/resource.h>
#include <sys/socket.h>

#include "absl/strings/match.h"

namespace isomatch {
namespace {

using testing::AllOf;
using testing::AnyOf;
using testing::Each;
using testing::Eq;
using testing::HasSubstr;
using testing::StartsWith;

/// Until then a peer must have heard something.
constexpr timeval kPatience = {.tv_sec = 20, .tv_usec = 0};

FileDescriptor NewClient() {
  FileDescriptor client(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
  setsockopt(client.get(), SOL_SOCKET, SO_RCVTIMEO, &kPatience,
             sizeof(kPatience));
  return client;
}

void Connect(const FileDescriptor& client, const std::string& listener) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  address.sin_port = htons(static_cast<std::uint16_t>(
      std::stoi(listener.substr(listener.rfind(':') + 1))));
  ASSERT_EQ(connect(client.get(), reinterpret_cast<const sockaddr*>(&address),
                    sizeof(address)),
            0);
}

/// What the listener's side says first: "!" of a taken connection, "" when it
/// was closed, "?" when nothing came.
std::string Hear(const FileDescriptor& client) {
  char byte = 0;
  const ssize_t got = recv(client.get(), &byte, 1, 0);
  if (got > 0) return {byte};
  return got == 0 || errno == ECONNRESET ? "" : "?";
}

class AcceptLoopTest : public testing::Test {
 protected:
  void Start(const ConnectionLimits& limits) {
    auto loop = AcceptLoop::Listen("127.0.0.1:0", limits);
    ASSERT_TRUE(loop.ok()) << loop.status();
    loop_ = *std::move(loop);
    loop_->Start([this](int socket) {
      taken_.emplace_back(socket);
      send(socket, "!", 1, MSG_NOSIGNAL);
    });
  }

  std::string ConnectAndHear(const FileDescriptor& client) const {
    Connect(client, loop_->address());
    return Hear(client);
  }

  // Of the loop's thread; what a client has heard of is there.
  std::vector<FileDescriptor> taken_;
  std::unique_ptr<AcceptLoop> loop_;
};

TEST_F(AcceptLoopTest, HandsOverWhoConnects) {
  Start({.most = 10, .of_one_address = 0});
  const FileDescriptor one = NewClient();
  const FileDescriptor two = NewClient();
  EXPECT_EQ(ConnectAndHear(one), "!");
  EXPECT_EQ(ConnectAndHear(two), "!");
  EXPECT_EQ(loop_->CountOpen(), 2);
  EXPECT_TRUE(fcntl(taken_[0].get(), F_GETFL) & O_NONBLOCK);
  EXPECT_TRUE(fcntl(taken_[0].get(), F_GETFD) & FD_CLOEXEC);
  EXPECT_EQ(loop_->refused(), 0);
}

TEST_F(AcceptLoopTest, ClosesWhoIsTooMuchUntilAnotherHasGone) {
  testing::internal::CaptureStdout();  // of the log
  Start({.most = 2, .of_one_address = 0});
  std::vector<FileDescriptor> clients;
  for (const std::string said : {"!", "!", "", "", ""}) {
    clients.push_back(NewClient());
    EXPECT_EQ(ConnectAndHear(clients.back()), said);
  }
  EXPECT_EQ(loop_->refused(), 3);
  loop_->Stop();
  const std::string log = testing::internal::GetCapturedStdout();
  EXPECT_THAT(log, HasSubstr("--max-connections allows"));
  EXPECT_EQ(log.find("refused"), log.rfind("refused")) << "a line each";
}

// This machine has no limit per address.
TEST_F(AcceptLoopTest, TakesAnotherOnceOneHasGone) {
  Start({.most = 1, .of_one_address = 1});
  EXPECT_EQ(ConnectAndHear(NewClient()), "!");
  taken_.clear();
  std::string heard;
  while (heard.empty()) heard = ConnectAndHear(NewClient());
  EXPECT_EQ(heard, "!");
}

/// Leaves this process no descriptor while it lives.
class NoDescriptors {
 public:
  NoDescriptors() {
    getrlimit(RLIMIT_NOFILE, &before_);
    rlimit low = before_;
    low.rlim_cur = 256;
    setrlimit(RLIMIT_NOFILE, &low);
    for (int file = 0; file >= 0;) {
      file = fcntl(STDIN_FILENO, F_DUPFD_CLOEXEC, 0);
      if (file >= 0) files_.emplace_back(file);
    }
  }
  ~NoDescriptors() { setrlimit(RLIMIT_NOFILE, &before_); }

  void LeaveOneMore() { files_.pop_back(); }

 private:
  rlimit before_{};
  std::vector<FileDescriptor> files_;
};

TEST_F(AcceptLoopTest, SurvivesThatThereAreNoDescriptors) {
  testing::internal::CaptureStdout();  // of the log
  Start({.most = 1000, .of_one_address = 0});
  std::vector<FileDescriptor> clients;
  for (int i = 0; i < 5; ++i) clients.push_back(NewClient());
  {
    const NoDescriptors none;
    for (const FileDescriptor& client : clients) {
      EXPECT_EQ(ConnectAndHear(client), "");
    }
  }
  EXPECT_EQ(ConnectAndHear(NewClient()), "!");
  // A refused one hears of it before it is counted, the next one after that.
  EXPECT_EQ(loop_->refused(), 5);
  loop_->Stop();
  EXPECT_THAT(testing::internal::GetCapturedStdout(),
              HasSubstr("the process has no file descriptor left"));
}

// With each more that is left it gets further.
TEST(AcceptLoopListenTest, TellsThatThereAreTooFewDescriptors) {
  std::vector<std::string> told;
  {
    NoDescriptors none;
    while (true) {
      const auto loop = AcceptLoop::Listen("127.0.0.1:0", {});
      if (loop.ok()) break;
      EXPECT_EQ(loop.status().code(), absl::StatusCode::kUnavailable);
      told.emplace_back(loop.status().message());
      none.LeaveOneMore();
    }
  }
  EXPECT_THAT(told,
              Each(Eq("cannot listen on 127.0.0.1:0: Too many open files")));
  EXPECT_GE(told.size(), 3U);  // listener, spare, stop
}

/// What this process has open, by descriptor, but the folder that tells so.
std::map<std::string, std::string> OpenFiles() {
  std::map<std::string, std::string> found;
  for (const auto& entry :
       std::filesystem::directory_iterator("/proc/self/fd")) {
    const std::string file = std::filesystem::read_symlink(entry.path());
    if (!absl::EndsWith(file, "/fd")) found[entry.path()] = file;
  }
  return found;
}

// There may be none: a container without /dev has no /dev/null.
TEST_F(AcceptLoopTest, NeedsNoFile) {
  const auto before = OpenFiles();
  Start({.most = 10, .of_one_address = 0});
  int added = 0;
  for (const auto& [descriptor, file] : OpenFiles()) {
    if (before.count(descriptor) > 0) continue;
    ++added;
    EXPECT_THAT(file, AnyOf(StartsWith("socket:"), "anon_inode:[eventfd]"));
  }
  EXPECT_GE(added, 3);  // listener, spare, stop
}

TEST_F(AcceptLoopTest, AfterStopNobodyIsHandedOver) {
  Start({.most = 10, .of_one_address = 0});
  loop_->Stop();
  loop_->Stop();
  const FileDescriptor client = NewClient();
  Connect(client, loop_->address());  // the system still answers
  loop_.reset();
  EXPECT_EQ(Hear(client), "");
  EXPECT_TRUE(taken_.empty());
}

TEST(RefusalsTest, AnEpisodeHasALineAtItsBeginAndOneAtItsEnd) {
  testing::internal::CaptureStdout();  // of the log
  Refusals refusals;
  const Refusals::Clock::time_point begin;
  EXPECT_FALSE(refusals.is_open());
  for (int i = 0; i < 1000; ++i) {
    refusals.Add(Refusal::kTooManyOfOrigin, begin);
  }
  EXPECT_TRUE(refusals.is_open());
  refusals.Tell(begin + Refusals::kQuiet / 2);
  EXPECT_TRUE(refusals.is_open());
  refusals.Tell(begin + Refusals::kQuiet);
  EXPECT_FALSE(refusals.is_open());
  EXPECT_EQ(refusals.total(), 1000);
  const std::string log = testing::internal::GetCapturedStdout();
  EXPECT_EQ(std::count(log.begin(), log.end(), '\n'), 2) << log;
  EXPECT_THAT(log,
              AllOf(HasSubstr("new connections are refused: one address"),
                    HasSubstr("no longer refused; 1000 were: one address")));
}

}  // namespace
}  // namespace isomatch
