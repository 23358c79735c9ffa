// Who may connect and who may call, seen from outside.

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>
#include <openssl/err.h>
#include <openssl/ssl.h>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "core/base/sha256.h"
#include "grpc/health/v1/health.grpc.pb.h"
#include "server/jobs/caller.h"
#include "tests/server/test_certificates.h"
#include "tests/server/test_server.h"
#include "tests/support/matchers.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

using testing::AllOf;
using testing::AnyOf;
using testing::HasSubstr;
using Stub = v1::CorrespondenceService::Stub;

grpc::Status CallInfo(const std::shared_ptr<grpc::Channel>& channel,
                      const std::string& key = "",
                      v1::GetServerInfoResponse* info = nullptr) {
  grpc::ClientContext context;
  if (!key.empty()) context.AddMetadata("api-key", key);
  v1::GetServerInfoResponse ignored;
  return v1::CorrespondenceService::NewStub(channel)->GetServerInfo(
      &context, {}, info == nullptr ? &ignored : info);
}

// Calls until it succeeds; returns how long that took, or infinity after 20 s.
absl::Duration TimeUntilOk(const std::function<grpc::Status()>& call) {
  const absl::Time begin = absl::Now();
  while (absl::Now() < begin + absl::Seconds(20)) {
    if (call().ok()) return absl::Now() - begin;
    absl::SleepFor(absl::Milliseconds(100));
  }
  return absl::InfiniteDuration();
}

class TlsTest : public TestServer {
 protected:
  // Files are exchanged as an operator should: each at once.
  void Install(const std::string& name, const std::string& bytes) const {
    folder_.Write(name + ".new", bytes);
    std::filesystem::rename(folder_.Path(name + ".new"), folder_.Path(name));
  }

  void Install(const TestCertificate& certificate) const {
    Install("server.pem", certificate.certificate + certificate.key);
  }

  ServerConfig TlsConfig() const {
    ServerConfig config = TestConfig();
    config.tls_cert = folder_.Path("server.pem");
    config.tls_key = config.tls_cert;
    return config;
  }

  void Start(const TestCertificate& certificate) {
    Install(certificate);
    Restart(TlsConfig());
  }

  // Clients must show a certificate of `authority_`.
  void StartMutual() {
    Install(authority_.Issue());
    Install("ca.pem", authority_.certificate());
    ServerConfig config = TlsConfig();
    config.tls_client_ca = folder_.Path("ca.pem");
    Restart(config);
  }

  std::shared_ptr<grpc::Channel> Connect(
      const TestAuthority& authority, const TestCertificate& own = {}) const {
    return grpc::CreateChannel(
        server_->address(), grpc::SslCredentials({authority.certificate(),
                                                  own.key, own.certificate}));
  }

  static void ExpectNoConnection(
      const std::shared_ptr<grpc::Channel>& channel) {
    const grpc::Status status = CallInfo(channel);
    EXPECT_EQ(status.error_code(), grpc::StatusCode::UNAVAILABLE)
        << status.error_message();
  }

  const TestAuthority authority_;
  const TestAuthority other_authority_{"another authority"};
  const TemporaryFolder folder_;
};

TEST_F(TlsTest, TheServerIsKnownByItsAuthorityOnly) {
  Start(authority_.Issue());
  EXPECT_TRUE(CallInfo(Connect(authority_)).ok());
  ExpectNoConnection(Connect(other_authority_));
  ExpectNoConnection(channel_);  // without TLS
}

TEST_F(TlsTest, AnExpiredCertificateOfTheServerIsRefused) {
  Start(authority_.Issue(-absl::Minutes(1)));
  ExpectNoConnection(Connect(authority_));
}

TEST_F(TlsTest, ClientsMustShowAGoodCertificateWhereTheServerAsks) {
  StartMutual();
  EXPECT_TRUE(CallInfo(Connect(authority_, authority_.Issue())).ok());
  ExpectNoConnection(Connect(authority_));
  ExpectNoConnection(Connect(authority_, other_authority_.Issue()));
  ExpectNoConnection(Connect(authority_, authority_.Issue(-absl::Minutes(1))));
}

// Does a handshake with exactly this version of TLS. Returns 1, or 0 and, in
// `reason`, why not in OpenSSL's numbers.
int Handshake(const std::string& address, int version, int* reason) {
  const std::unique_ptr<SSL_CTX, decltype(&SSL_CTX_free)> context(
      SSL_CTX_new(TLS_client_method()), SSL_CTX_free);
  // Else our own side would refuse what is old.
  SSL_CTX_set_security_level(context.get(), 0);
  SSL_CTX_set_min_proto_version(context.get(), version);
  SSL_CTX_set_max_proto_version(context.get(), version);
  constexpr unsigned char kHttp2[] = {2, 'h', '2'};
  SSL_CTX_set_alpn_protos(context.get(), kHttp2, sizeof(kHttp2));
  const std::unique_ptr<BIO, decltype(&BIO_free_all)> connection(
      BIO_new_ssl_connect(context.get()), BIO_free_all);
  BIO_set_conn_hostname(connection.get(), address.c_str());
  const bool done = BIO_do_handshake(connection.get()) == 1;
  *reason = ERR_GET_REASON(ERR_peek_error());
  ERR_clear_error();
  return done ? 1 : 0;
}

TEST_F(TlsTest, VersionsBefore12AreRefused) {
  Start(authority_.Issue());
  int reason = 0;
  EXPECT_EQ(Handshake(server_->address(), TLS1_3_VERSION, &reason), 1);
  EXPECT_EQ(Handshake(server_->address(), TLS1_2_VERSION, &reason), 1);
  for (const int version : {TLS1_1_VERSION, TLS1_VERSION}) {
    EXPECT_EQ(Handshake(server_->address(), version, &reason), 0);
    // The server ends the connection; our side alone would say that it has no
    // protocol.
    EXPECT_THAT(reason, AnyOf(SSL_R_TLSV1_ALERT_PROTOCOL_VERSION,
                              SSL_R_UNEXPECTED_EOF_WHILE_READING));
  }
}

TEST_F(TlsTest, ANewCertificateIsServedWithin3SecondsAndStreamsLiveOn) {
  Start(authority_.Issue());
  gate_open_ = false;
  stub_ = v1::CorrespondenceService::NewStub(Connect(authority_));
  const std::string name = CreateJob();
  WaitForMatches(1);
  grpc::ClientContext context;
  v1::WatchJobRequest request;
  request.set_name(name);
  const auto reader = stub_->WatchJob(&context, request);
  v1::WatchJobResponse response;
  ASSERT_TRUE(reader->Read(&response));

  Install(other_authority_.Issue());
  EXPECT_LE(TimeUntilOk([&] { return CallInfo(Connect(other_authority_)); }),
            absl::Seconds(3));
  ExpectNoConnection(Connect(authority_));

  gate_open_ = true;
  while (reader->Read(&response)) {
  }
  EXPECT_EQ(response.job().state(), v1::Job::STATE_SUCCEEDED);
  EXPECT_TRUE(reader->Finish().ok());
}

TEST_F(TlsTest, ANewAuthorityOfClientsHoldsWithin3Seconds) {
  StartMutual();
  const TestCertificate of_other = other_authority_.Issue();
  ExpectNoConnection(Connect(authority_, of_other));
  Install("ca.pem", other_authority_.certificate());
  EXPECT_LE(
      TimeUntilOk([&] { return CallInfo(Connect(authority_, of_other)); }),
      absl::Seconds(3));
  ExpectNoConnection(Connect(authority_, authority_.Issue()));
}

TEST_F(TlsTest, FilesThatDoNotFitTogetherKeepTheCertificateBefore) {
  ServerConfig config = TestConfig();
  config.tls_cert = folder_.Path("crt");
  config.tls_key = folder_.Path("key");
  const TestCertificate first = authority_.Issue();
  Install("crt", first.certificate);
  Install("key", first.key);
  Restart(config);
  testing::internal::CaptureStdout();  // of the log
  const auto expect_first_for_2_seconds = [this] {
    const absl::Time begin = absl::Now();
    while (absl::Now() < begin + absl::Seconds(2.5)) {
      ASSERT_TRUE(CallInfo(Connect(authority_)).ok());
      absl::SleepFor(absl::Milliseconds(100));
    }
  };
  const TestCertificate second = other_authority_.Issue();
  Install("crt", second.certificate);
  expect_first_for_2_seconds();
  std::filesystem::remove(folder_.Path("crt"));
  expect_first_for_2_seconds();
  const std::string log = testing::internal::GetCapturedStdout();
  EXPECT_THAT(log, AllOf(HasSubstr("certificates: not reloaded, the earlier "
                                   "ones stay in force: --tls-key"),
                         HasSubstr("No such file")));
  Install("crt", second.certificate);
  Install("key", second.key);
  EXPECT_LE(TimeUntilOk([&] { return CallInfo(Connect(other_authority_)); }),
            absl::Seconds(3));
}

TEST_F(TlsTest, FilesThatAreWrongAtTheStartAreAnError) {
  ServerConfig config = TlsConfig();
  EXPECT_THAT(Server::Create(config, GatedEngine()),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("--tls-cert = " + config.tls_cert),
                             HasSubstr("No such file"))));
  config = TestConfig();
  config.api_keys = folder_.Path("none");
  EXPECT_THAT(Server::Create(config, GatedEngine()),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("--api-keys = " + config.api_keys)));
}

// One RPC with an empty request, which may fail once the caller is let in.
struct Rpc {
  const char* name;
  Role needed;
  std::function<grpc::Status(Stub&, grpc::ClientContext*)> call;
};

template <typename Request, typename Response>
auto Unary(grpc::Status (Stub::*method)(grpc::ClientContext*, const Request&,
                                        Response*)) {
  return [method](Stub& stub, grpc::ClientContext* context) {
    Response response;
    return (stub.*method)(context, {}, &response);
  };
}

grpc::Status Watch(Stub& stub, grpc::ClientContext* context) {
  return stub.WatchJob(context, {})->Finish();
}

grpc::Status Download(Stub& stub, grpc::ClientContext* context) {
  return stub.DownloadResult(context, {})->Finish();
}

// Sends nothing, not even that there is no more: who is refused is told before
// any byte is taken, others after the idle timeout.
grpc::Status Upload(Stub& stub, grpc::ClientContext* context) {
  v1::UploadMeshResponse response;
  return stub.UploadMesh(context, &response)->Finish();
}

std::vector<Rpc> AllRpcs() {
  return {{"GetServerInfo", Role::kRead, Unary(&Stub::GetServerInfo)},
          {"FindMissingMeshes", Role::kRead, Unary(&Stub::FindMissingMeshes)},
          {"GetJob", Role::kRead, Unary(&Stub::GetJob)},
          {"ListJobs", Role::kRead, Unary(&Stub::ListJobs)},
          {"WatchJob", Role::kRead, Watch},
          {"DownloadResult", Role::kRead, Download},
          {"UploadMesh", Role::kSubmit, Upload},
          {"CreateJob", Role::kSubmit, Unary(&Stub::CreateJob)},
          {"CancelJob", Role::kSubmit, Unary(&Stub::CancelJob)},
          {"DeleteJob", Role::kSubmit, Unary(&Stub::DeleteJob)}};
}

class ApiKeyTest : public TestServer {
 protected:
  ApiKeyTest() {
    WriteKeys({"read", "submit", "admin"});
    ServerConfig config = TestConfig();
    config.api_keys = folder_.Path("keys");
    config.upload_idle_timeout = absl::Milliseconds(50);
    Restart(config);
  }

  // One key of each role, its text the role's name, of the tenant lab-ROLE.
  void WriteKeys(const std::vector<std::string>& roles) const {
    std::string text;
    for (const std::string& role : roles) {
      absl::StrAppend(&text, role, " lab-", role, " ", role, " ",
                      Sha256Hex(role), "\n");
    }
    folder_.Write("keys", text);
  }

  grpc::Status Call(const Rpc& rpc, const std::string& key) {
    grpc::ClientContext context;
    if (!key.empty()) context.AddMetadata("authorization", "Bearer " + key);
    return rpc.call(*stub_, &context);
  }

  void ExpectRefused(const Rpc& rpc, const std::string& key,
                     grpc::StatusCode code, const std::string& reason) {
    const CallError error = ErrorOf(Call(rpc, key));
    EXPECT_EQ(error.code, code) << rpc.name;
    EXPECT_EQ(error.reason, reason) << rpc.name;
  }

  void ExpectLetIn(const Rpc& rpc, const std::string& key) {
    const grpc::StatusCode code = Call(rpc, key).error_code();
    EXPECT_NE(code, grpc::StatusCode::UNAUTHENTICATED) << rpc.name;
    EXPECT_NE(code, grpc::StatusCode::PERMISSION_DENIED) << rpc.name;
  }

  const TemporaryFolder folder_;
};

TEST_F(ApiKeyTest, EveryRpcNeedsAKeyWithItsRole) {
  const std::vector<Rpc> rpcs = AllRpcs();
  EXPECT_EQ(rpcs.size(),
            v1::Job::descriptor()->file()->service(0)->method_count());
  for (const Rpc& rpc : rpcs) {
    ExpectRefused(rpc, "", grpc::StatusCode::UNAUTHENTICATED,
                  "API_KEY_MISSING");
    ExpectRefused(rpc, "wrong", grpc::StatusCode::UNAUTHENTICATED,
                  "API_KEY_WRONG");
    if (rpc.needed == Role::kRead) {
      ExpectLetIn(rpc, "read");
    } else {
      ExpectRefused(rpc, "read", grpc::StatusCode::PERMISSION_DENIED,
                    "ROLE_TOO_LOW");
    }
    ExpectLetIn(rpc, "submit");
    ExpectLetIn(rpc, "admin");
  }
}

TEST_F(ApiKeyTest, InformationTellsTheTenantOfTheKey) {
  v1::GetServerInfoResponse info;
  EXPECT_TRUE(CallInfo(channel_, "submit", &info).ok());
  EXPECT_EQ(info.tenant(), "lab-submit");
  Restart(TestConfig());
  EXPECT_TRUE(CallInfo(channel_, "", &info).ok());
  EXPECT_EQ(info.tenant(), "default");
}

TEST_F(ApiKeyTest, HealthNeedsNoKey) {
  grpc::ClientContext context;
  grpc::health::v1::HealthCheckResponse response;
  EXPECT_TRUE(grpc::health::v1::Health::NewStub(channel_)
                  ->Check(&context, {}, &response)
                  .ok());
}

TEST_F(ApiKeyTest, AKeyOutsideTheFileEndsAndANewOneBegins) {
  WriteKeys({"read"});
  EXPECT_LE(TimeUntilOk([&] {
              return CallInfo(channel_, "submit").ok() ? grpc::Status::CANCELLED
                                                       : grpc::Status::OK;
            }),
            absl::Seconds(3));
  EXPECT_TRUE(CallInfo(channel_, "read").ok());
  WriteKeys({"read", "submit"});
  EXPECT_LE(TimeUntilOk([&] { return CallInfo(channel_, "submit"); }),
            absl::Seconds(3));
}

}  // namespace
}  // namespace isomatch
