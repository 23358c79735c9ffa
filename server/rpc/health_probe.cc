#include "server/rpc/health_probe.h"

#include <memory>
#include <utility>
#include <vector>

#include <grpcpp/create_channel.h>
#include <grpcpp/security/credentials.h>
#include <grpcpp/security/tls_certificate_provider.h>
#include <grpcpp/security/tls_certificate_verifier.h>
#include <grpcpp/security/tls_credentials_options.h>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "core/base/status_macros.h"
#include "grpc/health/v1/health.grpc.pb.h"

namespace isomatch {
namespace {

absl::StatusOr<std::shared_ptr<grpc::ChannelCredentials>> Credentials(
    const TlsFiles& files) {
  namespace tls = grpc::experimental;
  if (files.certificate.empty()) return grpc::InsecureChannelCredentials();
  ISOMATCH_ASSIGN_OR_RETURN(const TlsContent content, ReadTlsFiles(files));
  const std::string& pem = content.identity_pem;
  tls::TlsChannelCredentialsOptions options;
  options.set_verify_server_certs(false);
  options.set_check_call_host(false);
  options.set_certificate_verifier(
      std::make_shared<tls::NoOpCertificateVerifier>());
  // gRPC wants authorities even where it is not to ask them, and a container
  // has none of its own.
  options.set_certificate_provider(
      std::make_shared<tls::StaticDataCertificateProvider>(
          pem, std::vector<tls::IdentityKeyCertPair>{{pem, pem}}));
  options.watch_root_certs();
  options.watch_identity_key_cert_pairs();
  return tls::TlsCredentials(options);
}

}  // namespace

std::string ProbeAddress(const std::string& listen) {
  for (const auto& [all, loopback] :
       {std::pair("0.0.0.0:", "127.0.0.1:"), std::pair("[::]:", "[::1]:")}) {
    if (absl::StartsWith(listen, all)) {
      return absl::StrCat(loopback, listen.substr(std::string(all).size()));
    }
  }
  return listen;
}

absl::Status ProbeHealth(const std::string& address, const TlsFiles& tls,
                         absl::Duration timeout) {
  ISOMATCH_ASSIGN_OR_RETURN(const auto credentials, Credentials(tls));
  grpc::ChannelArguments arguments;
  arguments.SetInt(GRPC_ARG_ENABLE_HTTP_PROXY, 0);
  const auto stub = grpc::health::v1::Health::NewStub(
      grpc::CreateCustomChannel(address, credentials, arguments));
  grpc::ClientContext context;
  context.set_deadline(absl::ToChronoTime(absl::Now() + timeout));
  grpc::health::v1::HealthCheckResponse response;
  const grpc::Status status = stub->Check(&context, {}, &response);
  if (!status.ok()) {
    return {static_cast<absl::StatusCode>(status.error_code()),
            status.error_message()};
  }
  using Response = grpc::health::v1::HealthCheckResponse;
  if (response.status() == Response::SERVING) return absl::OkStatus();
  return absl::UnavailableError(
      Response::ServingStatus_Name(response.status()));
}

}  // namespace isomatch
