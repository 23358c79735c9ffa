#include "server/rpc/listening_sockets.h"

#include <cerrno>
#include <cstdint>
#include <cstring>
#include <memory>
#include <utility>

#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

constexpr int kUserTimeoutMilliseconds = 20'000;
constexpr int kOn = 1;
constexpr int kOff = 0;

/// An address of any family, as bind takes it.
struct Endpoint {
  sockaddr_storage address{};
  socklen_t size = 0;

  const sockaddr* get() const {
    return reinterpret_cast<const sockaddr*>(&address);
  }
};

/// NOT_FOUND: an address that is not of this machine, or of IPv6 where there is
/// none.
absl::Status LastError() {
  const bool is_not_here = errno == EADDRNOTAVAIL || errno == EAFNOSUPPORT;
  return {is_not_here ? absl::StatusCode::kNotFound
                      : absl::StatusCode::kUnavailable,
          std::strerror(errno)};
}

/// Returns a socket that listens there. Errors of LastError.
absl::StatusOr<FileDescriptor> ListenOn(const Endpoint& endpoint) {
  const int family = endpoint.address.ss_family;
  FileDescriptor made(
      socket(family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
  if (!made.is_open()) return LastError();
  if (family != AF_UNIX) {
    setsockopt(made.get(), SOL_SOCKET, SO_REUSEADDR, &kOn, sizeof(kOn));
    setsockopt(made.get(), IPPROTO_TCP, TCP_NODELAY, &kOn, sizeof(kOn));
    setsockopt(made.get(), IPPROTO_TCP, TCP_USER_TIMEOUT,
               &kUserTimeoutMilliseconds, sizeof(kUserTimeoutMilliseconds));
  }
  if (family == AF_INET6) {
    setsockopt(made.get(), IPPROTO_IPV6, IPV6_V6ONLY, &kOff, sizeof(kOff));
  }
  if (bind(made.get(), endpoint.get(), endpoint.size) != 0 ||
      listen(made.get(), SOMAXCONN) != 0) {
    return LastError();
  }
  return made;
}

std::uint16_t& PortField(Endpoint& endpoint) {
  return endpoint.address.ss_family == AF_INET6
             ? reinterpret_cast<sockaddr_in6&>(endpoint.address).sin6_port
             : reinterpret_cast<sockaddr_in&>(endpoint.address).sin_port;
}

/// In the order of the network.
std::uint16_t PortOf(const FileDescriptor& socket) {
  Endpoint own;
  own.size = sizeof(own.address);
  getsockname(socket.get(), reinterpret_cast<sockaddr*>(&own.address),
              &own.size);
  return PortField(own);
}

absl::StatusOr<std::vector<Endpoint>> Resolve(const std::string& host,
                                              const std::string& port) {
  addrinfo hints{};
  hints.ai_socktype = SOCK_STREAM;
  hints.ai_flags = AI_PASSIVE | AI_NUMERICSERV;
  addrinfo* found = nullptr;
  const int error = getaddrinfo(host.c_str(), port.c_str(), &hints, &found);
  if (error != 0) return absl::UnavailableError(gai_strerror(error));
  const std::unique_ptr<addrinfo, decltype(&freeaddrinfo)> owner(found,
                                                                 freeaddrinfo);
  std::vector<Endpoint> endpoints;
  for (; found != nullptr; found = found->ai_next) {
    Endpoint& endpoint = endpoints.emplace_back();
    std::memcpy(&endpoint.address, found->ai_addr, found->ai_addrlen);
    endpoint.size = found->ai_addrlen;
  }
  return endpoints;
}

bool IsWildcard(const std::string& host) {
  return host == "0.0.0.0" || host == "::";
}

/// Whether somebody answers there.
bool IsServed(const Endpoint& endpoint) {
  const FileDescriptor probe(socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
  return connect(probe.get(), endpoint.get(), endpoint.size) == 0;
}

void RemoveSocket(const std::string& path) {
  struct stat status {};
  if (lstat(path.c_str(), &status) == 0 && S_ISSOCK(status.st_mode)) {
    unlink(path.c_str());
  }
}

}  // namespace

absl::StatusOr<ListeningSockets> ListeningSockets::Open(
    const std::string& address) {
  ListeningSockets made;
  absl::Status status;
  absl::string_view path = address;
  const size_t colon = address.rfind(':');
  if (absl::ConsumePrefix(&path, "unix:")) {
    absl::ConsumePrefix(&path, "//");  // as in unix:///run/socket
    made.address_ = address;
    status = made.OpenUnix(std::string(path));
  } else {
    absl::string_view host = absl::string_view(address).substr(0, colon);
    if (absl::ConsumePrefix(&host, "[")) absl::ConsumeSuffix(&host, "]");
    status = made.OpenInet(std::string(host), address.substr(colon + 1));
  }
  if (!status.ok()) {
    return absl::UnavailableError(
        absl::StrCat("cannot listen on ", address, ": ", status.message()));
  }
  if (made.address_.empty()) {
    made.address_ = absl::StrCat(address.substr(0, colon), ":",
                                 ntohs(PortOf(made.sockets_.front())));
  }
  return made;
}

ListeningSockets::~ListeningSockets() {
  if (!path_.empty() && !sockets_.empty()) RemoveSocket(path_);
}

absl::Status ListeningSockets::OpenUnix(const std::string& path) {
  Endpoint endpoint;
  auto& address = reinterpret_cast<sockaddr_un&>(endpoint.address);
  if (path.empty() || path.size() >= sizeof(address.sun_path)) {
    return absl::UnavailableError(absl::StrCat("expected a path of 1 to ",
                                               sizeof(address.sun_path) - 1,
                                               " bytes after unix:"));
  }
  address.sun_family = AF_UNIX;
  std::memcpy(address.sun_path, path.data(), path.size());
  endpoint.size = sizeof(address);
  if (IsServed(endpoint)) {
    return absl::UnavailableError(std::strerror(EADDRINUSE));
  }
  RemoveSocket(path);
  ISOMATCH_ASSIGN_OR_RETURN(FileDescriptor socket, ListenOn(endpoint));
  sockets_.push_back(std::move(socket));
  path_ = path;
  return absl::OkStatus();
}

absl::Status ListeningSockets::OpenInet(const std::string& host,
                                        const std::string& port) {
  // All addresses: a socket of IPv6 takes both kinds, where there is IPv6.
  const bool is_wildcard = IsWildcard(host);
  ISOMATCH_ASSIGN_OR_RETURN(std::vector<Endpoint> endpoints,
                            Resolve(is_wildcard ? "::" : host, port));
  if (is_wildcard) {
    ISOMATCH_ASSIGN_OR_RETURN(const auto ipv4, Resolve("0.0.0.0", port));
    endpoints.insert(endpoints.end(), ipv4.begin(), ipv4.end());
  }
  absl::Status failed;
  for (Endpoint& endpoint : endpoints) {
    if (!sockets_.empty()) {
      if (is_wildcard) break;
      PortField(endpoint) = PortOf(sockets_.front());
    }
    absl::StatusOr<FileDescriptor> socket = ListenOn(endpoint);
    if (socket.ok()) {
      sockets_.push_back(*std::move(socket));
      continue;
    }
    failed = socket.status();
    // A name such as `localhost` has two addresses: one of them is enough where
    // the user did not choose the port.
    const bool may_miss = absl::IsNotFound(failed) || !sockets_.empty();
    if (!may_miss || (port != "0" && !absl::IsNotFound(failed))) return failed;
  }
  return sockets_.empty() ? failed : absl::OkStatus();
}

}  // namespace isomatch
