// The real isomatch-server as a process.

#include <csignal>
#include <memory>
#include <string>

#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include "absl/time/clock.h"
#include "isomatch/v1/service.grpc.pb.h"
#include "tests/server/child_process.h"
#include "tests/server/test_server.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

using testing::HasSubstr;

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

TEST(MainTest, SaysHowToSendAFirstJob) {
  ServerProcess server(ISOMATCH_SERVER_BINARY);
  EXPECT_THAT(server.process.ReadUntil("isomatch match --server "),
              HasSubstr(server.address));
  server.process.Signal(SIGINT);
  EXPECT_EQ(server.process.ExitStatus(), 0);
}

TEST(MainTest, APortInUseEndsWithStatusOne) {
  const ServerProcess first(ISOMATCH_SERVER_BINARY);
  ChildProcess second(ISOMATCH_SERVER_BINARY, {"--listen", first.address});
  EXPECT_THAT(second.ReadUntil("cannot listen on "), HasSubstr(first.address));
  EXPECT_EQ(second.ExitStatus(), 1);
}

TEST(MainTest, WrongFlagsEndWithStatusTwo) {
  ChildProcess server(ISOMATCH_SERVER_BINARY, {"--listen", "0.0.0.0:0"});
  EXPECT_THAT(server.ReadUntil("--listen"), HasSubstr("--insecure"));
  EXPECT_EQ(server.ExitStatus(), 2);
}

}  // namespace
}  // namespace isomatch
