// The real isomatch-server as a process.

#include <csignal>
#include <cstdint>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/time/clock.h"
#include "core/base/file_descriptor.h"
#include "isomatch/v1/service.grpc.pb.h"
#include "tests/server/child_process.h"
#include "tests/server/test_server.h"
#include "tests/support/shapes.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

using testing::HasSubstr;
using testing::Not;

std::unique_ptr<v1::CorrespondenceService::Stub> Connect(
    const std::string& address) {
  return v1::CorrespondenceService::NewStub(
      grpc::CreateChannel(address, grpc::InsecureChannelCredentials()));
}

// A job that takes seconds.
std::string StartLongJob(v1::CorrespondenceService::Stub& stub) {
  v1::CreateJobRequest request;
  *request.mutable_mesh_x() = ToDraco(BumpySphere(6));
  *request.mutable_mesh_y() = ToDraco(BumpySphere(6));
  grpc::ClientContext context;
  v1::CreateJobResponse response;
  const grpc::Status status = stub.CreateJob(&context, request, &response);
  EXPECT_TRUE(status.ok()) << status.error_message();
  return response.job().name();
}

TEST(MainTest, ServesUntilSigtermAndExitsWithZero) {
  ServerProcess server(ISOMATCH_SERVER_BINARY);
  const auto stub = Connect(server.address);
  grpc::ClientContext context;
  v1::GetServerInfoResponse info;
  EXPECT_TRUE(stub->GetServerInfo(&context, {}, &info).ok());
  server.process.Signal(SIGTERM);
  EXPECT_EQ(server.process.ExitStatus(), 0);
}

TEST(MainTest, SigtermWaitsForAJobAsLongAsTheDrainTimeout) {
  ServerProcess server(ISOMATCH_SERVER_BINARY, {"--drain-timeout", "1s"});
  const auto stub = Connect(server.address);
  const std::string name = StartLongJob(*stub);
  server.process.ReadUntil("RUNNING");
  const absl::Time begin = absl::Now();
  server.process.Signal(SIGTERM);
  server.process.ReadUntil("stopping");
  absl::SleepFor(absl::Milliseconds(200));
  grpc::ClientContext context;
  v1::GetServerInfoResponse info;
  EXPECT_TRUE(stub->GetServerInfo(&context, {}, &info).ok());
  EXPECT_TRUE(info.draining());
  EXPECT_EQ(info.running_jobs(), 1);
  EXPECT_EQ(server.process.ExitStatus(), 0);
  EXPECT_GE(absl::Now() - begin, absl::Seconds(1));
  EXPECT_LT(absl::Now() - begin, absl::Seconds(2.5));
}

TEST(MainTest, ASecondSignalEndsItAtOnce) {
  ServerProcess server(ISOMATCH_SERVER_BINARY);
  StartLongJob(*Connect(server.address));
  server.process.ReadUntil("RUNNING");
  server.process.Signal(SIGTERM);
  server.process.ReadUntil("stopping");
  const absl::Time begin = absl::Now();
  server.process.Signal(SIGINT);
  EXPECT_EQ(server.process.ExitStatus(), 1);
  EXPECT_LT(absl::Now() - begin, absl::Seconds(1));
}

TEST(MainTest, AFileThatMayNotGrowDoesNotEndIt) {
  ServerProcess server(ISOMATCH_SERVER_BINARY);
  server.process.Signal(SIGXFSZ);  // what the system sends then
  const auto stub = Connect(server.address);
  grpc::ClientContext context;
  v1::GetServerInfoResponse info;
  EXPECT_TRUE(stub->GetServerInfo(&context, {}, &info).ok());
  server.process.Signal(SIGTERM);
  EXPECT_EQ(server.process.ExitStatus(), 0);
}

TEST(MainTest, SaysHowToSendAFirstJob) {
  ServerProcess server(ISOMATCH_SERVER_BINARY);
  EXPECT_THAT(server.process.ReadUntil("isomatch match --server "),
              HasSubstr(server.address));
  server.process.Signal(SIGINT);
  EXPECT_EQ(server.process.ExitStatus(), 0);
}

TEST(MainTest, SaysWhereTheMetricsAre) {
  ServerProcess server(ISOMATCH_SERVER_BINARY);
  EXPECT_THAT(server.process.ReadUntil("metrics: "),
              testing::MatchesRegex("http://127.0.0.1:[0-9]+/metrics"));
}

TEST(MainTest, EveryLineOfAJsonLogIsAnObject) {
  ChildProcess server(
      ISOMATCH_SERVER_BINARY,
      {"--ephemeral", "--listen", "127.0.0.1:0", "--metrics-listen", "off",
       "--log-format", "json", "--log-level", "debug"});
  const std::string rest = server.ReadUntil("\"address\":\"");
  const std::string address = rest.substr(0, rest.find('"'));
  grpc::ClientContext context;
  v1::GetServerInfoResponse info;
  EXPECT_TRUE(Connect(address)->GetServerInfo(&context, {}, &info).ok());
  server.Signal(SIGTERM);
  int calls = 0;
  for (const std::string& line : server.ReadLines()) {
    const nlohmann::json json = nlohmann::json::parse(line);
    EXPECT_TRUE(json.contains("time") && json.contains("message")) << line;
    if (json.value("code", "") == "OK") ++calls;
  }
  EXPECT_EQ(calls, 1);
  EXPECT_EQ(server.ExitStatus(), 0);
}

/// The exit status of --health with these flags, and its line.
struct Health {
  int status;
  std::string line;
};
Health AskHealth(std::vector<std::string> flags) {
  const TemporaryFolder folder;
  const std::string out = folder.Path("line");
  flags.insert(flags.begin(), "--health");
  ChildProcess probe(ISOMATCH_SERVER_BINARY, flags, out);
  const std::vector<std::string> errors = probe.ReadLines();
  const int status = probe.ExitStatus();
  std::ifstream file(out);
  std::string line;
  std::getline(file, line);
  EXPECT_EQ(errors.size(), status == 0 ? 0 : 1);
  return {status, errors.empty() ? line : errors[0]};
}

TEST(MainTest, HealthIsZeroWhileTheServerServes) {
  ServerProcess server(ISOMATCH_SERVER_BINARY);
  Health health = AskHealth({"--listen", server.address});
  EXPECT_EQ(health.status, 0);
  EXPECT_EQ(health.line, server.address + " SERVING");
  EXPECT_EQ(AskHealth({server.address}).status, 0);
  server.process.Signal(SIGTERM);
  EXPECT_EQ(server.process.ExitStatus(), 0);
  health = AskHealth({server.address});
  EXPECT_EQ(health.status, 1);
  EXPECT_THAT(health.line, HasSubstr(server.address));
}

TEST(MainTest, HealthIsOneWhileTheServerDrains) {
  ServerProcess server(ISOMATCH_SERVER_BINARY, {"--drain-timeout", "20s"});
  StartLongJob(*Connect(server.address));
  server.process.ReadUntil("RUNNING");
  server.process.Signal(SIGTERM);
  server.process.ReadUntil("stopping");
  Health health = AskHealth({server.address});
  while (health.status == 0) health = AskHealth({server.address});
  EXPECT_EQ(health.status, 1);
  EXPECT_THAT(health.line, HasSubstr("NOT_SERVING"));
}

TEST(MainTest, HealthDoesNotWaitForAServerThatSaysNothing) {
  const int silent = socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof(address);
  ASSERT_EQ(bind(silent, reinterpret_cast<sockaddr*>(&address), size), 0);
  ASSERT_EQ(listen(silent, /*backlog=*/4), 0);
  getsockname(silent, reinterpret_cast<sockaddr*>(&address), &size);
  const Health health =
      AskHealth({"127.0.0.1:" + std::to_string(ntohs(address.sin_port))});
  EXPECT_EQ(health.status, 1);
  close(silent);
}

TEST(MainTest, APortInUseEndsWithStatusOne) {
  const ServerProcess first(ISOMATCH_SERVER_BINARY);
  ChildProcess second(ISOMATCH_SERVER_BINARY,
                      {"--ephemeral", "--listen", first.address});
  EXPECT_THAT(second.ReadUntil("cannot listen on "), HasSubstr(first.address));
  EXPECT_EQ(second.ExitStatus(), 1);
}

TEST(MainTest, AcceptedJobsSurviveThatItIsKilled) {
  const TemporaryFolder folder;
  const std::vector<std::string> flags = {"--data-dir", folder.Path("data")};
  std::vector<std::string> names;
  {
    ServerProcess server(ISOMATCH_SERVER_BINARY, flags);
    const auto stub = Connect(server.address);
    for (int i = 0; i < 2; ++i) names.push_back(StartLongJob(*stub));
    server.process.ReadUntil("RUNNING");
    server.process.Signal(SIGKILL);
    EXPECT_EQ(server.process.ExitStatus(), -1);
  }
  ServerProcess server(ISOMATCH_SERVER_BINARY, flags);
  const auto stub = Connect(server.address);
  std::uint32_t attempts = 0;
  for (const std::string& name : names) {
    grpc::ClientContext context;
    v1::WatchJobRequest request;
    request.set_name(name);
    const auto reader = stub->WatchJob(&context, request);
    v1::WatchJobResponse last;
    while (reader->Read(&last)) {
    }
    EXPECT_TRUE(reader->Finish().ok());
    EXPECT_EQ(last.job().state(), v1::Job::STATE_SUCCEEDED);
    attempts += last.job().attempt();
  }
  EXPECT_EQ(attempts, 3);  // only the one that ran is run again
}

/// A server on free ports that may have so many open files.
struct ServerOfFewFiles {
  ServerOfFewFiles(int files, const std::vector<std::string>& flags)
      : process("/bin/sh", Arguments(files, flags)),
        address(process.ReadUntil("listens on ")) {}

  static std::vector<std::string> Arguments(
      int files, const std::vector<std::string>& flags) {
    std::vector<std::string> all = {
        "-c",
        absl::StrCat("ulimit -n ", files, "; exec \"$0\" \"$@\""),
        ISOMATCH_SERVER_BINARY,
        "--ephemeral",
        "--listen",
        "127.0.0.1:0",
        "--metrics-listen",
        "off"};
    all.insert(all.end(), flags.begin(), flags.end());
    return all;
  }

  ChildProcess process;
  std::string address;
};

// Connections that say nothing, of peers without a key.
std::vector<FileDescriptor> ConnectOften(const std::string& address,
                                         int count) {
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  to.sin_port = htons(static_cast<std::uint16_t>(
      std::stoi(address.substr(address.rfind(':') + 1))));
  std::vector<FileDescriptor> made;
  for (int i = 0; i < count; ++i) {
    made.emplace_back(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
    EXPECT_EQ(connect(made.back().get(), reinterpret_cast<sockaddr*>(&to),
                      sizeof(to)),
              0);
  }
  return made;
}

// gRPC 1.51 by itself accepts nobody any more then.
TEST(MainTest, ItServesAfterMorePeersThanItMayHaveFiles) {
  ServerOfFewFiles server(128, {});
  const auto before = Connect(server.address);
  grpc::ClientContext first;
  v1::GetServerInfoResponse info;
  EXPECT_TRUE(before->GetServerInfo(&first, {}, &info).ok());
  std::vector<FileDescriptor> peers = ConnectOften(server.address, 200);
  server.process.ReadUntil("new connections are refused: ");
  grpc::ClientContext meanwhile;
  EXPECT_TRUE(before->GetServerInfo(&meanwhile, {}, &info).ok());
  peers.clear();
  grpc::ClientContext after;
  after.set_wait_for_ready(true);
  after.set_deadline(absl::ToChronoTime(absl::Now() + absl::Seconds(20)));
  EXPECT_TRUE(Connect(server.address)->GetServerInfo(&after, {}, &info).ok());
}

TEST(MainTest, ItMayHaveAsManyFilesAsTheSystemAllows) {
  ChildProcess server(
      "/bin/sh", {"-c", "ulimit -Sn 64; ulimit -Hn 400; exec \"$0\" \"$@\"",
                  ISOMATCH_SERVER_BINARY, "--ephemeral", "--listen",
                  "127.0.0.1:0", "--metrics-listen", "off"});
  EXPECT_THAT(server.ReadUntil("connections: at most "), HasSubstr("300"));
}

TEST(MainTest, WhoOpensItToOthersIsToldOfFloods) {
  const std::vector<std::string> open = {"--listen",         "0.0.0.0:0",
                                         "--insecure",       "--ephemeral",
                                         "--metrics-listen", "off"};
  ChildProcess exposed(ISOMATCH_SERVER_BINARY, open);
  EXPECT_THAT(exposed.ReadUntil("can be reached by other machines"),
              HasSubstr("--behind-edge"));
  std::vector<std::string> behind = open;
  behind.push_back("--behind-edge");
  for (const auto& flags : {behind,
                            {"--ephemeral", "--listen", "127.0.0.1:0",
                             "--metrics-listen", "off"}}) {
    ChildProcess server(ISOMATCH_SERVER_BINARY, flags);
    server.ReadUntil("a first job");
    server.Signal(SIGTERM);
    EXPECT_THAT(absl::StrJoin(server.ReadLines(), "\n"),
                Not(HasSubstr("can be reached")));
  }
}

TEST(MainTest, AFolderInUseEndsWithStatusOne) {
  const TemporaryFolder folder;
  const std::string data = folder.Path("data");
  const ServerProcess first(ISOMATCH_SERVER_BINARY, {"--data-dir", data});
  ChildProcess second(ISOMATCH_SERVER_BINARY,
                      {"--data-dir", data, "--listen", "127.0.0.1:0"});
  EXPECT_THAT(second.ReadUntil("isomatch-server: "), HasSubstr(data));
  EXPECT_EQ(second.ExitStatus(), 1);
}

TEST(MainTest, WrongFlagsEndWithStatusTwo) {
  ChildProcess server(ISOMATCH_SERVER_BINARY, {"--listen", "0.0.0.0:0"});
  EXPECT_THAT(server.ReadUntil("--listen"), HasSubstr("--insecure"));
  EXPECT_EQ(server.ExitStatus(), 2);
}

TEST(MainTest, FilesThatAreWrongEndWithStatusOne) {
  ChildProcess server(ISOMATCH_SERVER_BINARY,
                      {"--listen", "127.0.0.1:0", "--api-keys", "/none"});
  EXPECT_THAT(server.ReadUntil("--api-keys = /none, expected "),
              HasSubstr("No such file"));
  EXPECT_EQ(server.ExitStatus(), 1);
}

TEST(MainTest, AKeyItMadeOpensItAndIsNeverInTheLog) {
  const TemporaryFolder folder;
  const std::string file = folder.Path("keys.txt");
  ChildProcess maker(ISOMATCH_SERVER_BINARY, {"--new-api-key", "alice"}, file);
  maker.ReadUntil("# The API key of alice");
  const std::string key = "isomatch_" + maker.ReadUntil("isomatch_");
  EXPECT_EQ(maker.ExitStatus(), 0);
  ServerProcess server(ISOMATCH_SERVER_BINARY,
                       {"--api-keys", file, "--log-level", "trace"});
  const auto stub = Connect(server.address);
  for (const std::string& sent : {key, key + "x"}) {
    grpc::ClientContext context;
    context.AddMetadata("authorization", "Bearer " + sent);
    v1::GetServerInfoResponse info;
    EXPECT_EQ(stub->GetServerInfo(&context, {}, &info).ok(), sent == key);
  }
  // What the reload says has no key either, nor the line that is wrong.
  folder.Write("keys.txt", "alice default submit " + key);
  absl::SleepFor(absl::Seconds(1));
  grpc::ClientContext context;
  context.AddMetadata("api-key", key);
  v1::GetServerInfoResponse info;
  EXPECT_TRUE(stub->GetServerInfo(&context, {}, &info).ok());
  server.process.Signal(SIGTERM);
  const std::string log = absl::StrJoin(server.process.ReadLines(), "\n");
  EXPECT_THAT(
      log,
      HasSubstr("not reloaded, the earlier ones stay in force: --api-keys = " +
                file + ": line 1, expected"));
  EXPECT_THAT(log, Not(HasSubstr(key.substr(9, 12))));
}

}  // namespace
}  // namespace isomatch
