#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/time/time.h"

namespace isomatch {

/// Where to reach a server of this machine that listens on `listen`, a
/// ServerConfig::listen: the loopback address when it listens on all.
std::string ProbeAddress(const std::string& listen);

/// How the probed server talks. With TLS its certificate is not verified: the
/// probe sends nothing secret and believes only "serving".
enum class ProbeTransport { kPlain, kTls };

/// OK when the server at `address`, HOST:PORT or unix:PATH, says within
/// `timeout` that it serves. UNAVAILABLE when it says otherwise; else what the
/// call failed with.
absl::Status ProbeHealth(const std::string& address, ProbeTransport transport,
                         absl::Duration timeout);

}  // namespace isomatch
