#include "tests/client/api/tcp_proxy.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <utility>

namespace isomatch {
namespace {

sockaddr_in Loopback(int port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  return address;
}

bool SendAll(int socket, const char* bytes, ssize_t size) {
  while (size > 0) {
    const ssize_t sent =
        send(socket, bytes, static_cast<std::size_t>(size), MSG_NOSIGNAL);
    if (sent <= 0) return false;
    bytes += sent;
    size -= sent;
  }
  return true;
}

}  // namespace

TcpProxy::TcpProxy(const std::string& target)
    : target_port_(std::stoi(target.substr(target.rfind(':') + 1))) {
  sockaddr_in address = Loopback(0);
  socklen_t size = sizeof(address);
  listener_ = socket(AF_INET, SOCK_STREAM, 0);
  bind(listener_, reinterpret_cast<sockaddr*>(&address), size);
  listen(listener_, /*backlog=*/16);
  getsockname(listener_, reinterpret_cast<sockaddr*>(&address), &size);
  port_ = ntohs(address.sin_port);
  accept_ = std::jthread([this] { Accept(); });
}

TcpProxy::~TcpProxy() {
  shutdown(listener_, SHUT_RDWR);
  accept_.join();
  Cut();
  pumps_.clear();  // joins
  for (const int socket : sockets_) close(socket);
  close(listener_);
}

std::string TcpProxy::address() const {
  return "127.0.0.1:" + std::to_string(port_);
}

void TcpProxy::Cut() {
  const std::lock_guard lock(mutex_);
  CutLocked();
}

void TcpProxy::CutAfter(Direction direction, std::int64_t bytes) {
  const std::lock_guard lock(mutex_);
  cut_at_[direction] = passed_[direction] + bytes;
}

void TcpProxy::RefuseAll() {
  const std::lock_guard lock(mutex_);
  refuses_ = true;
  CutLocked();
}

std::int64_t TcpProxy::bytes_passed(Direction direction) const {
  const std::lock_guard lock(mutex_);
  return passed_[direction];
}

int TcpProxy::cuts() const {
  const std::lock_guard lock(mutex_);
  return cuts_;
}

void TcpProxy::Accept() {
  for (int client; (client = accept(listener_, nullptr, nullptr)) >= 0;) {
    const sockaddr_in address = Loopback(target_port_);
    const int server = socket(AF_INET, SOCK_STREAM, 0);
    connect(server, reinterpret_cast<const sockaddr*>(&address),
            sizeof(address));
    const std::lock_guard lock(mutex_);
    sockets_.insert(sockets_.end(), {client, server});
    if (refuses_) CutLocked();
    pumps_.emplace_back([=, this] { Pump(client, server, kToServer); });
    pumps_.emplace_back([=, this] { Pump(server, client, kToClient); });
  }
}

void TcpProxy::Pump(int from, int to, Direction direction) {
  std::array<char, 16384> bytes;
  while (true) {
    const ssize_t size = recv(from, bytes.data(), bytes.size(), 0);
    if (size <= 0 || !Count(direction, size) ||
        !SendAll(to, bytes.data(), size)) {
      break;
    }
  }
  shutdown(from, SHUT_RDWR);
  shutdown(to, SHUT_RDWR);
}

// False when these bytes are lost because the connections are cut.
bool TcpProxy::Count(Direction direction, std::int64_t bytes) {
  const std::lock_guard lock(mutex_);
  passed_[direction] += bytes;
  if (passed_[direction] < cut_at_[direction]) return true;
  cut_at_[direction] = std::numeric_limits<std::int64_t>::max();
  CutLocked();
  return false;
}

void TcpProxy::CutLocked() {
  ++cuts_;
  for (const int socket : sockets_) shutdown(socket, SHUT_RDWR);
}

}  // namespace isomatch
