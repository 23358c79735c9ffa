// What belongs to the server as a whole: information, health, reflection.

#include <memory>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"
#include "core/base/version.h"
#include "grpc/health/v1/health.grpc.pb.h"
#include "tests/server/test_server.h"
#include "tests/support/matchers.h"

namespace isomatch {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;
using Health = grpc::health::v1::HealthCheckResponse;

class ServiceTest : public TestServer {
 protected:
  Health::ServingStatus Check(const std::string& service) {
    const auto stub = grpc::health::v1::Health::NewStub(channel_);
    grpc::ClientContext context;
    grpc::health::v1::HealthCheckRequest request;
    request.set_service(service);
    Health response;
    EXPECT_TRUE(stub->Check(&context, request, &response).ok());
    return response.status();
  }

  /// Sends a ServerReflectionRequest, whose stub Debian does not package, and
  /// returns the response's bytes; none of a server without reflection.
  std::string Reflect(const std::string& request) {
    using Factory = grpc::internal::ClientReaderWriterFactory<grpc::ByteBuffer,
                                                              grpc::ByteBuffer>;
    const grpc::internal::RpcMethod method(
        "/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo",
        grpc::internal::RpcMethod::BIDI_STREAMING, channel_);
    grpc::ClientContext context;
    const std::unique_ptr<
        grpc::ClientReaderWriter<grpc::ByteBuffer, grpc::ByteBuffer>>
        stream(Factory::Create(channel_.get(), method, &context));
    const grpc::Slice slice(request);
    stream->Write(grpc::ByteBuffer(&slice, 1));
    grpc::ByteBuffer response;
    if (!stream->Read(&response)) {
      EXPECT_EQ(stream->Finish().error_code(), grpc::UNIMPLEMENTED);
      return "";
    }
    stream->WritesDone();
    EXPECT_TRUE(stream->Finish().ok());
    grpc::Slice bytes;
    EXPECT_TRUE(response.DumpToSingleSlice(&bytes).ok());
    return std::string(reinterpret_cast<const char*>(bytes.begin()),
                       bytes.size());
  }
};

TEST_F(ServiceTest, InformationTellsVersionLimitsAndLoad) {
  gate_open_ = false;
  CreateJob();
  WaitForMatches(1);
  grpc::ClientContext context;
  v1::GetServerInfoResponse info;
  ASSERT_TRUE(stub_->GetServerInfo(&context, {}, &info).ok());
  EXPECT_EQ(info.version(), kVersion);
  EXPECT_EQ(info.limits().max_request_bytes(), 4 << 20);
  EXPECT_EQ(info.limits().max_chunk_bytes(), 1 << 20);
  EXPECT_EQ(info.running_jobs(), 1);
  EXPECT_GE(info.memory_reserved_bytes(), 1 << 20);
  EXPECT_GT(info.memory_budget_bytes(), info.memory_reserved_bytes());
  EXPECT_FALSE(info.draining());
}

TEST_F(ServiceTest, IsHealthyAsAWholeAndByService) {
  EXPECT_EQ(Check(""), Health::SERVING);
  EXPECT_EQ(Check("isomatch.v1.CorrespondenceService"), Health::SERVING);
}

TEST_F(ServiceTest, IsNotServingWhileItDrainsAndTakesNoNewJobs) {
  gate_open_ = false;
  const std::string name = CreateJob();
  WaitForMatches(1);
  std::thread stopping([&] { server_->Shutdown(absl::Seconds(20)); });
  while (Check("") != Health::NOT_SERVING) std::this_thread::yield();
  EXPECT_EQ(Check("isomatch.v1.CorrespondenceService"), Health::NOT_SERVING);
  CallError error = CreateError(SphereJob());
  EXPECT_EQ(error.code, grpc::StatusCode::UNAVAILABLE);
  EXPECT_EQ(error.reason, "DRAINING");
  EXPECT_TRUE(error.has_retry);
  gate_open_ = true;
  EXPECT_EQ(Watch(name).back().state(), v1::Job::STATE_SUCCEEDED);
  stopping.join();
}

TEST_F(ServiceTest, HealthIsToldThatAnIdleServerStops) {
  std::thread stopping([&] { server_->Shutdown(absl::Seconds(20)); });
  // Check expects an answer each time.
  while (Check("") != Health::NOT_SERVING) {
    if (HasFailure()) break;
  }
  stopping.join();
}

TEST_F(ServiceTest, ReflectionListsAllServicesAndKnowsThem) {
  const std::string services = Reflect("\x3a\x01*");  // list_services = 7
  EXPECT_THAT(services, HasSubstr("isomatch.v1.CorrespondenceService"));
  EXPECT_THAT(services, HasSubstr("grpc.health.v1.Health"));
  const std::string symbol = "grpc.health.v1.Health";
  // file_containing_symbol = 4
  EXPECT_THAT(Reflect(absl::StrCat("\x22\x15", symbol)),
              HasSubstr("HealthCheckRequest"));
}

TEST_F(ServiceTest, WithoutReflectionNothingIsListed) {
  ServerConfig config = TestConfig();
  config.no_reflection = true;
  Restart(config, GatedEngine());
  EXPECT_THAT(Reflect("\x3a\x01*"), IsEmpty());
  EXPECT_EQ(Check(""), Health::SERVING);
}

TEST_F(ServiceTest, ARequestOverTheLimitIsRefused) {
  v1::CreateJobRequest request;
  request.mutable_mesh_x()->set_draco(std::string(5 << 20, 'x'));
  grpc::ClientContext context;
  v1::CreateJobResponse response;
  EXPECT_EQ(stub_->CreateJob(&context, request, &response).error_code(),
            grpc::StatusCode::RESOURCE_EXHAUSTED);
}

TEST_F(ServiceTest, APortInUseIsAnError) {
  ServerConfig config = TestConfig();
  config.listen = server_->address();
  EXPECT_THAT(
      Server::Create(config, GatedEngine()),
      StatusIs(absl::StatusCode::kUnavailable, HasSubstr(server_->address())));
}

TEST_F(ServiceTest, WithoutAPortItIsReachedInProcess) {
  ServerConfig config;
  config.listen = "";
  const auto server = Server::Create(config, GatedEngine());
  ASSERT_THAT(server, IsOk());
  EXPECT_EQ((*server)->address(), "");
  const auto stub =
      v1::CorrespondenceService::NewStub((*server)->InProcessChannel());
  grpc::ClientContext context;
  v1::GetServerInfoResponse info;
  EXPECT_TRUE(stub->GetServerInfo(&context, {}, &info).ok());
}

}  // namespace
}  // namespace isomatch
