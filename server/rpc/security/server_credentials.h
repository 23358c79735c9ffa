#pragma once

#include <memory>

#include <grpcpp/security/server_credentials.h>

#include "absl/status/statusor.h"
#include "server/rpc/security/certificate_watcher.h"
#include "server/rpc/security/tls_files.h"

namespace isomatch {

/// What a port is opened with. Outlives the gRPC server of that port.
struct PortCredentials {
  /// Null without TLS.
  std::unique_ptr<CertificateWatcher> watcher;
  std::shared_ptr<grpc::ServerCredentials> credentials;
};

/// Returns credentials without TLS when files.certificate is empty. Else TLS is
/// 1.2 or later; connections made 3 s after a change of the files get what is
/// in them, those already there go on. Files that do not fit together change
/// nothing; `on_reload` is told. Errors as ReadTlsFiles.
absl::StatusOr<PortCredentials> MakePortCredentials(
    const TlsFiles& files, CertificateWatcher::OnReload on_reload);

}  // namespace isomatch
