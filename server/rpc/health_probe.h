#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "server/rpc/security/tls_files.h"

namespace isomatch {

/// Where to reach a server of this machine that listens on `listen`, a
/// ServerConfig::listen: the loopback address when it listens on all.
std::string ProbeAddress(const std::string& listen);

/// OK when the server at `address`, HOST:PORT or unix:PATH, says within
/// `timeout` that it serves. UNAVAILABLE when it says otherwise; as
/// ReadTlsFiles of `tls`, the server's own files; else what the call failed
/// with.
///
/// With TLS the server's certificate is not verified: the probe sends nothing
/// secret and believes only "serving". A server that wants certificates of its
/// clients is shown its own.
absl::Status ProbeHealth(const std::string& address, const TlsFiles& tls,
                         absl::Duration timeout);

}  // namespace isomatch
