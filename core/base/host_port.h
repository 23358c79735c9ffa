#pragma once

#include <optional>
#include <string>

#include "absl/strings/string_view.h"

namespace isomatch {

/// An address of a TCP port, as in "localhost:7443" or "[::1]:7443".
struct HostPort {
  std::string host;
  int port = 0;
};

/// Returns the parts of HOST:PORT; none without a HOST, or with a PORT that is
/// not 0 to 65535. HOST may be any other text.
std::optional<HostPort> ParseHostPort(absl::string_view text);

/// Whether `host` is this machine: localhost, [::1] or 127.x.y.z, and no name
/// that begins so, which may be any other machine's.
bool IsLoopback(absl::string_view host);

/// The same of HOST:PORT, and for unix:PATH.
bool IsLoopbackAddress(absl::string_view address);

}  // namespace isomatch
