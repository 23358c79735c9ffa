#include "server/rpc/security/server_credentials.h"

#include <string>
#include <utility>

#include <grpcpp/security/tls_certificate_provider.h>
#include <grpcpp/security/tls_credentials_options.h>

#include "core/base/status_macros.h"

namespace isomatch {
namespace {

/// How often gRPC looks at the watcher's copies.
constexpr unsigned int kRefreshSeconds = 1;

}  // namespace

absl::StatusOr<PortCredentials> MakePortCredentials(
    const TlsFiles& files, CertificateWatcher::OnReload on_reload) {
  if (files.certificate.empty()) {
    return PortCredentials{nullptr, grpc::InsecureServerCredentials()};
  }
  PortCredentials made;
  ISOMATCH_ASSIGN_OR_RETURN(
      made.watcher, CertificateWatcher::Start(files, std::move(on_reload)));
  const std::string identity = made.watcher->identity_path();
  const std::string client_ca = made.watcher->client_ca_path();
  grpc::experimental::TlsServerCredentialsOptions options(
      std::make_shared<grpc::experimental::FileWatcherCertificateProvider>(
          identity, identity, client_ca, kRefreshSeconds));
  options.watch_identity_key_cert_pairs();
  if (!client_ca.empty()) {
    options.watch_root_certs();
    options.set_cert_request_type(
        GRPC_SSL_REQUEST_AND_REQUIRE_CLIENT_CERTIFICATE_AND_VERIFY);
  }
  made.credentials = grpc::experimental::TlsServerCredentials(options);
  return made;
}

}  // namespace isomatch
