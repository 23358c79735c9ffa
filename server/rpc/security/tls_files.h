#pragma once

#include <string>

#include "absl/status/statusor.h"

namespace isomatch {

/// PEM files of a server's TLS. An empty path stands for "none".
struct TlsFiles {
  /// The server's certificate, then those that lead to its authority. Without
  /// it there is no TLS.
  std::string certificate;
  /// The certificate's private key, without password. May be the same file.
  std::string key;
  /// With it, clients must show a certificate of one of these authorities.
  std::string client_ca;
};

/// What they hold.
struct TlsContent {
  /// The key and the certificates.
  std::string identity_pem;
  /// Empty when there is no such file.
  std::string client_ca_pem;
};

/// Returns the content of files that fit together. INVALID_ARGUMENT, naming
/// flag, path and what was expected: a file is missing, not readable or not
/// PEM, the key has a password, or is not that of the certificate.
/// REQUIRES: files.certificate and files.key are not empty.
absl::StatusOr<TlsContent> ReadTlsFiles(const TlsFiles& files);

}  // namespace isomatch
