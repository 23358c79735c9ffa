#include "server/rpc/health_probe.h"

#include <fstream>
#include <memory>
#include <string>

#include <gmock/gmock.h>
#include <grpc/grpc_security.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"
#include "grpc/health/v1/health.grpc.pb.h"
#include "tests/server/test_certificates.h"
#include "tests/support/matchers.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

using grpc::health::v1::HealthCheckRequest;
using grpc::health::v1::HealthCheckResponse;
using testing::HasSubstr;

/// A health service of which the test says what it answers.
class FakeHealth final : public grpc::health::v1::Health::Service {
 public:
  grpc::Status Check(grpc::ServerContext*, const HealthCheckRequest*,
                     HealthCheckResponse* response) override {
    response->set_status(status);
    return grpc::Status::OK;
  }

  HealthCheckResponse::ServingStatus status = HealthCheckResponse::SERVING;
};

class HealthProbeTest : public testing::Test {
 protected:
  void Start(const std::shared_ptr<grpc::ServerCredentials>& credentials) {
    grpc::EnableDefaultHealthCheckService(false);
    grpc::ServerBuilder builder;
    int port = 0;
    builder.AddListeningPort("127.0.0.1:0", credentials, &port);
    builder.RegisterService(&health_);
    server_ = builder.BuildAndStart();
    address_ = absl::StrCat("127.0.0.1:", port);
  }

  /// A server whose certificate is of `authority_`, in the files `tls_`.
  void StartTls(grpc_ssl_client_certificate_request_type request) {
    const TestCertificate own = authority_.Issue();
    tls_ = {folder_.Path("cert.pem"), folder_.Path("key.pem"), ""};
    std::ofstream(tls_.certificate) << own.certificate;
    std::ofstream(tls_.key) << own.key;
    grpc::SslServerCredentialsOptions options(request);
    options.pem_key_cert_pairs.push_back({own.key, own.certificate});
    options.pem_root_certs = authority_.certificate();
    Start(grpc::SslServerCredentials(options));
  }

  absl::Status Probe(const TlsFiles& tls) const {
    return ProbeHealth(address_, tls, absl::Seconds(10));
  }

  const TemporaryFolder folder_;
  const TestAuthority authority_;
  TlsFiles tls_;
  FakeHealth health_;
  std::unique_ptr<grpc::Server> server_;
  std::string address_;
};

TEST_F(HealthProbeTest, OnlyAServerThatServesIsHealthy) {
  Start(grpc::InsecureServerCredentials());
  EXPECT_THAT(Probe(TlsFiles{}), IsOk());
  health_.status = HealthCheckResponse::NOT_SERVING;
  EXPECT_THAT(Probe(TlsFiles{}),
              StatusIs(absl::StatusCode::kUnavailable, "NOT_SERVING"));
}

TEST_F(HealthProbeTest, NobodyThereIsNotHealthy) {
  EXPECT_FALSE(ProbeHealth("127.0.0.1:1", TlsFiles{}, absl::Seconds(10)).ok());
  EXPECT_FALSE(
      ProbeHealth("unix:/nowhere", TlsFiles{}, absl::Seconds(10)).ok());
}

TEST_F(HealthProbeTest, TlsWithAnyCertificateWillDo) {
  StartTls(GRPC_SSL_DONT_REQUEST_CLIENT_CERTIFICATE);
  EXPECT_THAT(Probe(tls_), IsOk());
  EXPECT_FALSE(Probe(TlsFiles{}).ok());
  health_.status = HealthCheckResponse::NOT_SERVING;
  EXPECT_THAT(Probe(tls_),
              StatusIs(absl::StatusCode::kUnavailable, "NOT_SERVING"));
}

TEST_F(HealthProbeTest, TlsNeedsNoAuthoritiesOfTheSystem) {
  grpc_set_ssl_roots_override_callback(
      [](char**) { return GRPC_SSL_ROOTS_OVERRIDE_FAIL_PERMANENTLY; });
  StartTls(GRPC_SSL_DONT_REQUEST_CLIENT_CERTIFICATE);
  EXPECT_THAT(Probe(tls_), IsOk());
}

TEST_F(HealthProbeTest, AServerThatWantsCertificatesIsShownItsOwn) {
  StartTls(GRPC_SSL_REQUEST_AND_REQUIRE_CLIENT_CERTIFICATE_AND_VERIFY);
  EXPECT_THAT(Probe(tls_), IsOk());
}

TEST_F(HealthProbeTest, FilesThatAreNotThereAreNamed) {
  StartTls(GRPC_SSL_DONT_REQUEST_CLIENT_CERTIFICATE);
  tls_.key = folder_.Path("nowhere.pem");
  EXPECT_THAT(Probe(tls_), StatusIs(absl::StatusCode::kInvalidArgument,
                                    HasSubstr("nowhere.pem")));
}

TEST_F(HealthProbeTest, AServerOnAllAddressesIsProbedOnLoopback) {
  EXPECT_EQ(ProbeAddress("0.0.0.0:7443"), "127.0.0.1:7443");
  EXPECT_EQ(ProbeAddress("[::]:7443"), "[::1]:7443");
  EXPECT_EQ(ProbeAddress("10.0.0.1:7443"), "10.0.0.1:7443");
  EXPECT_EQ(ProbeAddress("unix:/run/isomatch"), "unix:/run/isomatch");
}

}  // namespace
}  // namespace isomatch
