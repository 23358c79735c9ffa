#include "server/rpc/health_probe.h"

#include <cstdio>
#include <memory>
#include <string>

#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>
#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/x509.h>

#include "absl/strings/str_cat.h"
#include "grpc/health/v1/health.grpc.pb.h"
#include "tests/support/matchers.h"

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

  absl::Status Probe(ProbeTransport transport) const {
    return ProbeHealth(address_, transport, absl::Seconds(10));
  }

  FakeHealth health_;
  std::unique_ptr<grpc::Server> server_;
  std::string address_;
};

/// Returns what `write` writes in PEM.
template <typename Write>
std::string ToPem(const Write& write) {
  const std::unique_ptr<BIO, decltype(&BIO_free)> out(BIO_new(BIO_s_mem()),
                                                      BIO_free);
  EXPECT_EQ(write(out.get()), 1);
  char* data = nullptr;
  const long size = BIO_get_mem_data(out.get(), &data);
  return {data, static_cast<size_t>(size)};
}

/// A new key, with a certificate that it signed itself.
grpc::SslServerCredentialsOptions::PemKeyCertPair SelfSigned() {
  const std::unique_ptr<EVP_PKEY, decltype(&EVP_PKEY_free)> key(
      EVP_EC_gen("P-256"), EVP_PKEY_free);
  const std::unique_ptr<X509, decltype(&X509_free)> certificate(X509_new(),
                                                                X509_free);
  X509_set_version(certificate.get(), X509_VERSION_3);
  X509_gmtime_adj(X509_getm_notBefore(certificate.get()), 0);
  X509_gmtime_adj(X509_getm_notAfter(certificate.get()), /*seconds=*/3600);
  X509_set_pubkey(certificate.get(), key.get());
  EXPECT_GT(X509_sign(certificate.get(), key.get(), EVP_sha256()), 0);
  return {ToPem([&](BIO* out) {
            return PEM_write_bio_PrivateKey(out, key.get(), nullptr, nullptr, 0,
                                            nullptr, nullptr);
          }),
          ToPem([&](BIO* out) {
            return PEM_write_bio_X509(out, certificate.get());
          })};
}

TEST_F(HealthProbeTest, OnlyAServerThatServesIsHealthy) {
  Start(grpc::InsecureServerCredentials());
  EXPECT_THAT(Probe(ProbeTransport::kPlain), IsOk());
  health_.status = HealthCheckResponse::NOT_SERVING;
  EXPECT_THAT(Probe(ProbeTransport::kPlain),
              StatusIs(absl::StatusCode::kUnavailable, "NOT_SERVING"));
}

TEST_F(HealthProbeTest, NobodyThereIsNotHealthy) {
  EXPECT_FALSE(
      ProbeHealth("127.0.0.1:1", ProbeTransport::kPlain, absl::Seconds(10))
          .ok());
  EXPECT_FALSE(
      ProbeHealth("unix:/nowhere", ProbeTransport::kPlain, absl::Seconds(10))
          .ok());
}

TEST_F(HealthProbeTest, TlsWithAnyCertificateWillDo) {
  grpc::SslServerCredentialsOptions options;
  options.pem_key_cert_pairs.push_back(SelfSigned());
  Start(grpc::SslServerCredentials(options));
  EXPECT_THAT(Probe(ProbeTransport::kTls), IsOk());
  EXPECT_FALSE(Probe(ProbeTransport::kPlain).ok());
  health_.status = HealthCheckResponse::NOT_SERVING;
  EXPECT_THAT(Probe(ProbeTransport::kTls),
              StatusIs(absl::StatusCode::kUnavailable, "NOT_SERVING"));
}

TEST_F(HealthProbeTest, AServerOnAllAddressesIsProbedOnLoopback) {
  EXPECT_EQ(ProbeAddress("0.0.0.0:7443"), "127.0.0.1:7443");
  EXPECT_EQ(ProbeAddress("[::]:7443"), "[::1]:7443");
  EXPECT_EQ(ProbeAddress("10.0.0.1:7443"), "10.0.0.1:7443");
  EXPECT_EQ(ProbeAddress("unix:/run/isomatch"), "unix:/run/isomatch");
}

}  // namespace
}  // namespace isomatch
