// SIGTERM while clients behave well, badly, or are gone.

#include <csignal>
#include <memory>
#include <string>
#include <vector>

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "tests/server/test_server.h"
#include "tests/soak/figures.h"
#include "tests/soak/known_jobs.h"
#include "tests/soak/soak_server.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

constexpr absl::Duration kDrain = absl::Seconds(1);

/// A TCP connection whose peer sends some bytes and then nothing more, and
/// reads nothing: as if its machine had lost power.
class HalfOpenPeer {
 public:
  HalfOpenPeer(const std::string& address, const std::string& bytes)
      : socket_(socket(AF_INET, SOCK_STREAM, 0)) {
    int port = 0;
    EXPECT_TRUE(
        absl::SimpleAtoi(address.substr(address.rfind(':') + 1), &port));
    sockaddr_in to{};
    to.sin_family = AF_INET;
    to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    to.sin_port = htons(static_cast<std::uint16_t>(port));
    EXPECT_EQ(connect(socket_, reinterpret_cast<sockaddr*>(&to), sizeof(to)),
              0);
    EXPECT_EQ(send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL),
              static_cast<ssize_t>(bytes.size()));
  }
  ~HalfOpenPeer() { close(socket_); }
  HalfOpenPeer(const HalfOpenPeer&) = delete;
  HalfOpenPeer& operator=(const HalfOpenPeer&) = delete;

 private:
  const int socket_;
};

/// What HTTP/2 peers send that stop in the middle.
std::vector<std::string> Beginnings() {
  const std::string preface = "PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n";
  const std::string settings("\0\0\0\4\0\0\0\0\0", 9);
  // 100 bytes of HEADERS of stream 1, neither ended nor all there.
  const std::string headers("\0\0\x64\1\0\0\0\0\1", 9);
  return {"", preface.substr(0, 10), preface + settings,
          preface + settings + headers,
          preface + settings + headers + std::string(20, '\x40')};
}

/// Streams of a client that opens them and then does nothing.
class IdleStreams {
 public:
  IdleStreams(Stub& stub, const std::string& job) {
    v1::WatchJobRequest request;
    request.set_name(job);
    watch_ = stub.WatchJob(&watch_context_, request);
    upload_ = stub.UploadMesh(&upload_context_, &response_);
    v1::UploadMeshRequest header;
    header.mutable_header()->set_sha256(std::string(64, 'c'));
    header.mutable_header()->set_size_bytes(1000);
    upload_->Write(header);
  }
  ~IdleStreams() {
    watch_context_.TryCancel();
    upload_context_.TryCancel();
    (void)watch_->Finish();
    (void)upload_->Finish();
  }

 private:
  CallContext watch_context_;
  CallContext upload_context_;
  std::unique_ptr<grpc::ClientReader<v1::WatchJobResponse>> watch_;
  v1::UploadMeshResponse response_;
  std::unique_ptr<grpc::ClientWriter<v1::UploadMeshRequest>> upload_;
};

struct Stopped {
  absl::Duration until_not_serving;
  absl::Duration until_exit;
};

/// Sends SIGTERM; the server has to exit with 0.
Stopped Stop(SoakServer& server) {
  EXPECT_TRUE(IsServing(server.channel()));
  Stopped stopped;
  const absl::Time begin = absl::Now();
  server.Signal(SIGTERM);
  while (IsServing(server.channel())) {
  }
  stopped.until_not_serving = absl::Now() - begin;
  EXPECT_EQ(server.ExitStatus(), 0);
  stopped.until_exit = absl::Now() - begin;
  return stopped;
}

TEST(ShutdownTest, IsInTimeWhateverThePeersDo) {
  Latencies not_serving;
  Latencies exit_busy;
  Latencies exit_idle;
  const int rounds = Rounds("ISOMATCH_SHUTDOWNS", 4, 40);
  for (int i = 0; i < rounds; ++i) {
    const TemporaryFolder folder;
    std::vector<std::string> flags = {"--drain-timeout", "1s"};
    if (i % 4 < 2) {
      flags.insert(flags.end(), {"--data-dir", folder.Path("data")});
    } else {
      flags.push_back("--ephemeral");
    }
    SoakServer server(flags);
    const bool is_busy = i % 2 == 0;
    std::string name = "jobs/00000000000000000000000000000000";
    if (is_busy) {
      const auto job = CreateJob(server.stub(), LongJob());
      ASSERT_TRUE(job.ok()) << job.status();
      name = job->name();
      WaitUntilRuns(server.stub(), name);
    }
    std::vector<std::unique_ptr<HalfOpenPeer>> peers;
    for (const std::string& bytes : Beginnings()) {
      peers.push_back(std::make_unique<HalfOpenPeer>(server.address(), bytes));
    }
    const IdleStreams streams(server.stub(), name);
    const Stopped stopped = Stop(server);
    not_serving.Add(stopped.until_not_serving);
    (is_busy ? exit_busy : exit_idle).Add(stopped.until_exit);
    EXPECT_GE(stopped.until_exit, is_busy ? kDrain : absl::ZeroDuration());
  }
  ExpectAtMost("SIGTERM: until NOT_SERVING, slowest",
               not_serving.Milliseconds(1), 100, "ms");
  const double most = absl::ToDoubleMilliseconds(kDrain) + 1000;
  ExpectAtMost("SIGTERM: exit, no job, half-open peers, drain 1 s",
               exit_idle.Milliseconds(1), most, "ms");
  ExpectAtMost("SIGTERM: exit, a long job, half-open peers, drain 1 s",
               exit_busy.Milliseconds(1), most, "ms");
}

}  // namespace
}  // namespace isomatch
