#include "core/base/host_port.h"

#include <arpa/inet.h>

#include "absl/strings/match.h"
#include "absl/strings/numbers.h"

namespace isomatch {

std::optional<HostPort> ParseHostPort(absl::string_view text) {
  constexpr int kMaxPort = 65535;
  const size_t colon = text.rfind(':');
  int port = -1;
  if (colon == absl::string_view::npos || colon == 0 ||
      !absl::SimpleAtoi(text.substr(colon + 1), &port) || port < 0 ||
      port > kMaxPort) {
    return std::nullopt;
  }
  return HostPort{std::string(text.substr(0, colon)), port};
}

bool IsLoopback(absl::string_view host) {
  in_addr address = {};
  return host == "localhost" || host == "[::1]" ||
         (absl::StartsWith(host, "127.") &&
          inet_pton(AF_INET, std::string(host).c_str(), &address) == 1);
}

bool IsLoopbackAddress(absl::string_view address) {
  return absl::StartsWith(address, "unix:") ||
         IsLoopback(address.substr(0, address.rfind(':')));
}

}  // namespace isomatch
