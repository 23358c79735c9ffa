#include "tests/support/database_proxy.h"

#include <algorithm>
#include <array>
#include <utility>

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

namespace isomatch {
namespace {

/// How soon threads see that they are to end.
constexpr int kPollMilliseconds = 50;

FileDescriptor Listen(int* port) {
  FileDescriptor listener(
      socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, /*protocol=*/0));
  sockaddr_in address = {};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof(address);
  auto* const generic = reinterpret_cast<sockaddr*>(&address);
  EXPECT_EQ(bind(listener.get(), generic, size), 0);
  EXPECT_EQ(listen(listener.get(), SOMAXCONN), 0);
  EXPECT_EQ(getsockname(listener.get(), generic, &size), 0);
  *port = ntohs(address.sin_port);
  return listener;
}

/// Returns a connection to a local socket; none when nobody listens.
FileDescriptor ConnectToSocket(const std::string& path) {
  FileDescriptor server(
      socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, /*protocol=*/0));
  sockaddr_un address = {};
  address.sun_family = AF_UNIX;
  path.copy(address.sun_path, sizeof(address.sun_path) - 1);
  const auto* const generic = reinterpret_cast<const sockaddr*>(&address);
  if (connect(server.get(), generic, sizeof(address)) != 0) return {};
  return server;
}

void CutBoth(const FileDescriptor& client, const FileDescriptor& server) {
  shutdown(client.get(), SHUT_RDWR);
  shutdown(server.get(), SHUT_RDWR);
}

/// Carries what there is to read; false at the end.
bool CarryOnce(int from, int to) {
  std::array<char, 1 << 16> bytes;
  const ssize_t count = recv(from, bytes.data(), bytes.size(), /*flags=*/0);
  for (ssize_t sent = 0; sent < count;) {
    const ssize_t more = send(to, bytes.data() + sent,
                              static_cast<size_t>(count - sent), MSG_NOSIGNAL);
    if (more <= 0) return false;
    sent += more;
  }
  return count > 0;
}

}  // namespace

DatabaseProxy::DatabaseProxy(std::string target)
    : target_(std::move(target)),
      listener_(Listen(&port_)),
      acceptor_([this] { Accept(); }) {}

DatabaseProxy::~DatabaseProxy() {
  is_stopped_ = true;
  acceptor_.join();
  CutAll();
  for (bool has_links = true; has_links;) {
    Tidy();
    MutexLock lock(mutex_);
    has_links = !links_.empty();
  }
}

DatabaseProxy::Mode DatabaseProxy::mode() {
  MutexLock lock(mutex_);
  return mode_;
}

void DatabaseProxy::Set(Mode mode) {
  MutexLock lock(mutex_);
  mode_ = mode;
  changed_.NotifyAll();
}

void DatabaseProxy::CutAll() {
  MutexLock lock(mutex_);
  for (Link& link : links_) {
    link.is_cut = true;
    CutBoth(link.client, link.server);
  }
  changed_.NotifyAll();
}

void DatabaseProxy::Accept() {
  while (!is_stopped_) {
    Tidy();
    pollfd waiting = {listener_.get(), POLLIN, 0};
    if (poll(&waiting, 1, kPollMilliseconds) <= 0) continue;
    if (mode() == Mode::kSilent) {  // they wait, as if packets were lost
      usleep(kPollMilliseconds * 1000);
      continue;
    }
    Connect(FileDescriptor(
        accept4(listener_.get(), nullptr, nullptr, SOCK_CLOEXEC)));
  }
}

void DatabaseProxy::Connect(FileDescriptor client) {
  const linger at_once = {1, 0};  // who is refused gets a reset
  setsockopt(client.get(), SOL_SOCKET, SO_LINGER, &at_once, sizeof(at_once));
  if (mode() == Mode::kRefuse) return;
  FileDescriptor server = ConnectToSocket(target_);
  if (!server.is_open()) return;
  MutexLock lock(mutex_);
  Link& link = links_.emplace_back();
  link.client = std::move(client);
  link.server = std::move(server);
  link.carrier = std::thread([this, &link] { Carry(link); });
}

bool DatabaseProxy::WaitWhileSilent(const Link& link) {
  MutexLock lock(mutex_);
  while (mode_ == Mode::kSilent && !link.is_cut) changed_.Wait(mutex_);
  return !link.is_cut;
}

void DatabaseProxy::Carry(Link& link) {
  const int client = link.client.get();
  const int server = link.server.get();
  for (bool goes_on = true; goes_on;) {
    std::array<pollfd, 2> ends = {{{client, POLLIN, 0}, {server, POLLIN, 0}}};
    if (poll(ends.data(), ends.size(), /*timeout=*/-1) < 0) continue;
    goes_on = WaitWhileSilent(link);
    if (goes_on && ends[0].revents != 0) goes_on = CarryOnce(client, server);
    if (goes_on && ends[1].revents != 0) goes_on = CarryOnce(server, client);
  }
  CutBoth(link.client, link.server);
  link.has_ended = true;
}

void DatabaseProxy::Tidy() {
  MutexLock lock(mutex_);
  for (auto link = links_.begin(); link != links_.end();) {
    if (!link->has_ended) {
      ++link;
      continue;
    }
    link->carrier.join();
    link = links_.erase(link);
  }
}

}  // namespace isomatch
