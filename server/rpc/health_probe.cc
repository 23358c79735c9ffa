#include "server/rpc/health_probe.h"

#include <memory>
#include <utility>

#include <grpcpp/create_channel.h>
#include <grpcpp/security/credentials.h>
#include <grpcpp/security/tls_certificate_verifier.h>
#include <grpcpp/security/tls_credentials_options.h>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "grpc/health/v1/health.grpc.pb.h"

namespace isomatch {
namespace {

std::shared_ptr<grpc::ChannelCredentials> Credentials(
    ProbeTransport transport) {
  namespace tls = grpc::experimental;
  if (transport == ProbeTransport::kPlain) {
    return grpc::InsecureChannelCredentials();
  }
  tls::TlsChannelCredentialsOptions options;
  options.set_verify_server_certs(false);
  options.set_check_call_host(false);
  options.set_certificate_verifier(
      std::make_shared<tls::NoOpCertificateVerifier>());
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

absl::Status ProbeHealth(const std::string& address, ProbeTransport transport,
                         absl::Duration timeout) {
  grpc::ChannelArguments arguments;
  arguments.SetInt(GRPC_ARG_ENABLE_HTTP_PROXY, 0);
  const auto stub = grpc::health::v1::Health::NewStub(
      grpc::CreateCustomChannel(address, Credentials(transport), arguments));
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
