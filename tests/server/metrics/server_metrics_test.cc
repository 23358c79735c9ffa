// A whole server, as Prometheus sees it.

#include <string>
#include <thread>

#include <gmock/gmock.h>
#include <grpcpp/impl/client_unary_call.h>
#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"
#include "core/base/sha256.h"
#include "core/base/version.h"
#include "tests/server/metrics/http_get.h"
#include "tests/server/test_server.h"
#include "tests/support/matchers.h"

namespace isomatch {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

class ServerMetricsTest : public TestServer {
 protected:
  ServerMetricsTest() {
    ServerConfig config = TestConfig();
    config.metrics_listen = "127.0.0.1:0";
    Restart(config);
  }

  std::string Scrape() const {
    return HttpGet(server_->metrics_address(), "/metrics");
  }

  /// Scrapes until the text is there; the test's timeout ends it.
  void WaitFor(const std::string& text) const {
    while (Scrape().find(text) == std::string::npos) std::this_thread::yield();
  }

  void Cancel(const std::string& name) {
    grpc::ClientContext context;
    v1::CancelJobRequest request;
    request.set_name(name);
    v1::CancelJobResponse response;
    EXPECT_TRUE(stub_->CancelJob(&context, request, &response).ok());
  }

  /// Uploads these bytes in one chunk.
  void Upload(const std::string& bytes) {
    grpc::ClientContext context;
    v1::UploadMeshResponse response;
    const auto writer = stub_->UploadMesh(&context, &response);
    v1::UploadMeshRequest request;
    request.mutable_header()->set_sha256(Sha256Hex(bytes));
    request.mutable_header()->set_size_bytes(bytes.size());
    writer->Write(request);
    request.set_chunk(bytes);
    writer->Write(request);
    writer->WritesDone();
    EXPECT_TRUE(writer->Finish().ok());
  }

  static std::string Handled(const std::string& method, const std::string& code,
                             int count) {
    return absl::StrCat("isomatch_grpc_server_handled_total{code=\"", code,
                        "\",method=\"", method, "\"} ", count, "\n");
  }
};

TEST_F(ServerMetricsTest, AJobThatRanIsSeen) {
  Watch(CreateJob());
  // Of what a job's end counts the last: whoever watches may see the end first.
  WaitFor("isomatch_memory_estimate_error_ratio_count 1\n");
  const std::string service = "isomatch.v1.CorrespondenceService/";
  const std::string text = Scrape();
  EXPECT_THAT(
      text,
      AllOf(HasSubstr("isomatch_jobs_total{reason=\"\",state=\"SUCCEEDED\"} 1"),
            HasSubstr("isomatch_queue_wait_seconds_count 1\n"),
            HasSubstr("isomatch_job_seconds_count{state=\"SUCCEEDED\"} 1\n"),
            HasSubstr("isomatch_run_seconds_count{stage=\"geodesics\"} 1\n"),
            HasSubstr("isomatch_run_seconds_count{stage=\"dense\"} 1\n"),
            HasSubstr("isomatch_jobs_queued{priority=\"normal\"} 0\n"),
            HasSubstr(absl::StrCat("isomatch_build_info{version=\"", kVersion,
                                   "\"} 1\n"))));
  EXPECT_THAT(text,
              AllOf(HasSubstr(Handled(service + "CreateJob", "OK", 1)),
                    HasSubstr(Handled(service + "WatchJob", "OK", 1)),
                    Not(HasSubstr("isomatch_stored_bytes 0\n")),
                    Not(HasSubstr("isomatch_memory_measured_bytes 0\n"))));
}

TEST_F(ServerMetricsTest, ConnectionsBeyondTheLimitAreRefusedAndCounted) {
  ServerConfig config = TestConfig();
  config.metrics_listen = "127.0.0.1:0";
  config.max_connections = 1;
  Restart(config);
  const auto ask = [](v1::CorrespondenceService::Stub& stub) {
    grpc::ClientContext context;
    v1::GetServerInfoResponse response;
    return stub.GetServerInfo(&context, {}, &response).ok();
  };
  EXPECT_TRUE(ask(*stub_));
  grpc::ChannelArguments own_connection;
  own_connection.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
  const auto other =
      v1::CorrespondenceService::NewStub(grpc::CreateCustomChannel(
          server_->address(), grpc::InsecureChannelCredentials(),
          own_connection));
  EXPECT_FALSE(ask(*other));
  EXPECT_THAT(Scrape(),
              AllOf(HasSubstr("isomatch_connections 1\n"),
                    HasSubstr("isomatch_connections_refused_total "),
                    Not(HasSubstr("isomatch_connections_refused_total 0\n"))));
  EXPECT_TRUE(ask(*stub_));
}

TEST_F(ServerMetricsTest, GaugesAreThoseOfTheMoment) {
  gate_open_ = false;
  const std::string running = CreateJob();
  WaitForMatches(1);
  v1::CreateJobRequest urgent = SphereJob();
  urgent.set_priority(7);
  const std::string queued = CreateJob(urgent);
  grpc::ClientContext context;
  v1::WatchJobRequest request;
  request.set_name(running);
  const auto watch = stub_->WatchJob(&context, request);
  v1::WatchJobResponse response;
  ASSERT_TRUE(watch->Read(&response));
  EXPECT_THAT(Scrape(),
              AllOf(HasSubstr("isomatch_jobs_queued{priority=\"high\"} 1\n"),
                    HasSubstr("isomatch_jobs_running 1\n"),
                    HasSubstr("isomatch_watchers 1\n"),
                    HasSubstr("isomatch_connections 1\n"),
                    HasSubstr("isomatch_connections_refused_total 0\n"),
                    Not(HasSubstr("memory_reserved_bytes 0\n"))));
  context.TryCancel();
  WaitFor("isomatch_watchers 0\n");
  WaitFor(
      Handled("isomatch.v1.CorrespondenceService/WatchJob", "CANCELLED", 1));
  Cancel(queued);
  Cancel(running);
  WaitFor("isomatch_jobs_running 0\n");
  EXPECT_THAT(
      Scrape(),
      AllOf(HasSubstr("isomatch_jobs_queued{priority=\"high\"} 0\n"),
            HasSubstr("isomatch_memory_reserved_bytes 0\n"),
            HasSubstr("isomatch_jobs_total{reason=\"\",state=\"CANCELLED\"} 2"),
            HasSubstr("isomatch_job_seconds_count{state=\"CANCELLED\"} 1\n")));
}

TEST_F(ServerMetricsTest, UploadsAreCountedAndKept) {
  Upload(std::string(1000, 'x'));
  EXPECT_THAT(Scrape(), AllOf(HasSubstr("isomatch_upload_bytes_total 1000\n"),
                              HasSubstr("isomatch_stored_bytes 1000\n")));
}

TEST_F(ServerMetricsTest, CallsAreCountedByCodeAndUnknownMethodsAsOne) {
  GetJob(CreateJob());
  for (const char* method :
       {"/isomatch.v1.CorrespondenceService/Nothing", "/made.Up/Service"}) {
    grpc::ClientContext context;
    v1::GetJobResponse response;
    const grpc::Status status = grpc::internal::BlockingUnaryCall(
        channel_.get(),
        grpc::internal::RpcMethod(method,
                                  grpc::internal::RpcMethod::NORMAL_RPC),
        &context, v1::GetJobRequest(), &response);
    EXPECT_EQ(status.error_code(), grpc::StatusCode::UNIMPLEMENTED);
  }
  grpc::ClientContext context;
  v1::GetJobResponse response;
  EXPECT_FALSE(stub_->GetJob(&context, {}, &response).ok());
  const std::string get_job = "isomatch.v1.CorrespondenceService/GetJob";
  const std::string text = Scrape();
  EXPECT_THAT(text, AllOf(HasSubstr(Handled(get_job, "OK", 1)),
                          HasSubstr(Handled(get_job, "INVALID_ARGUMENT", 1)),
                          HasSubstr(Handled("other", "UNIMPLEMENTED", 2)),
                          HasSubstr(absl::StrCat(
                              "isomatch_grpc_server_handling_seconds_count{"
                              "method=\"",
                              get_job, "\"} 2\n"))));
  EXPECT_THAT(text,
              AllOf(Not(HasSubstr("Nothing")), Not(HasSubstr("made.Up"))));
}

TEST_F(ServerMetricsTest, ATakenPortIsAnErrorAndOffIsNoEndpoint) {
  ServerConfig config = TestConfig();
  config.metrics_listen = server_->metrics_address();
  EXPECT_THAT(Server::Create(config, GatedEngine()),
              StatusIs(absl::StatusCode::kUnavailable,
                       HasSubstr(config.metrics_listen)));
  config.metrics_listen = "off";
  const auto without = Server::Create(config, GatedEngine());
  ASSERT_THAT(without, IsOk());
  EXPECT_EQ((*without)->metrics_address(), "");
  config = ServerConfig();
  config.listen = "";
  const auto embedded = Server::Create(config, GatedEngine());
  ASSERT_THAT(embedded, IsOk());
  EXPECT_EQ((*embedded)->metrics_address(), "");
}

}  // namespace
}  // namespace isomatch
