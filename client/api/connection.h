#pragma once

#include <memory>
#include <string>

#include <grpcpp/channel.h>

namespace isomatch {

/// What proves the server to us, and us to the server. Contents, not paths;
/// what is empty is left out.
struct ConnectionSecurity {
  /// PEM certificates of the authorities that vouch for the server. Empty: the
  /// connection is not encrypted.
  std::string ca_pem;
  /// PEM of our own certificate chain and its private key, for servers that ask
  /// for one (--tls-client-ca). Both or none; only with `ca_pem`.
  std::string certificate_pem;
  std::string key_pem;
  /// Sent with every call; passes IsApiKeyText.
  std::string api_key;
};

/// True when `text` can travel as an API key: 1 to 1024 visible ASCII
/// characters.
bool IsApiKeyText(const std::string& text);

/// Returns a channel to HOST:PORT, unix:PATH or IP:PORT,IP:PORT,...: the first
/// of several that answers, and another when it does not any more. It notices
/// within 40 s that a peer is gone which sent no farewell. With
/// `security.ca_pem` the server's certificate must be for HOST and TLS is 1.2
/// or later.
std::shared_ptr<grpc::Channel> ConnectTo(
    const std::string& address, const ConnectionSecurity& security = {});

}  // namespace isomatch
