#include "server/rpc/connection_table.h"

#include <cstring>
#include <utility>

#include <netinet/in.h>
#include <sys/stat.h>

namespace isomatch {
namespace {

constexpr std::chrono::milliseconds kSweepPause(20);

/// Tells a socket from all others of this process; 0 when it is none.
ino_t InodeOf(int file) {
  struct stat status {};
  if (fstat(file, &status) != 0 || !S_ISSOCK(status.st_mode)) return 0;
  return status.st_ino;
}

std::string OriginOfIpv4(const in_addr& address) {
  const bool is_loopback = ntohl(address.s_addr) >> 24 == 127;
  if (is_loopback) return "";
  return {reinterpret_cast<const char*>(&address), sizeof(address)};
}

std::string OriginOfIpv6(const in6_addr& address) {
  constexpr size_t kNetworkBytes = 8;
  if (IN6_IS_ADDR_LOOPBACK(&address)) return "";
  if (IN6_IS_ADDR_V4MAPPED(&address)) {
    in_addr mapped{};
    std::memcpy(&mapped, address.s6_addr + 12, sizeof(mapped));
    return OriginOfIpv4(mapped);
  }
  return {reinterpret_cast<const char*>(address.s6_addr), kNetworkBytes};
}

}  // namespace

std::string OriginOf(const sockaddr_storage& peer) {
  if (peer.ss_family == AF_INET) {
    return OriginOfIpv4(reinterpret_cast<const sockaddr_in&>(peer).sin_addr);
  }
  if (peer.ss_family == AF_INET6) {
    return OriginOfIpv6(reinterpret_cast<const sockaddr_in6&>(peer).sin6_addr);
  }
  return "";
}

ConnectionTable::Admission ConnectionTable::Admit(int socket,
                                                  const std::string& origin,
                                                  Clock::time_point now) {
  // Its number was another's before, which therefore has ended.
  if (const auto same = connections_.find(socket); same != connections_.end()) {
    Remove(same);
  }
  Admission admission = Judge(origin);
  if (admission != Admission::kAdmitted && last_sweep_ < now - kSweepPause) {
    last_sweep_ = now;
    Sweep();
    admission = Judge(origin);
  }
  if (admission != Admission::kAdmitted) return admission;
  connections_[socket] = {InodeOf(socket), origin};
  if (!origin.empty()) ++of_origin_[origin];
  return admission;
}

int ConnectionTable::CountOpen() {
  Sweep();
  return static_cast<int>(connections_.size());
}

ConnectionTable::Admission ConnectionTable::Judge(
    const std::string& origin) const {
  if (std::cmp_greater_equal(connections_.size(), limits_.most)) {
    return Admission::kTooMany;
  }
  if (origin.empty() || limits_.of_one_address == 0)
    return Admission::kAdmitted;
  const auto count = of_origin_.find(origin);
  return count == of_origin_.end() || count->second < limits_.of_one_address
             ? Admission::kAdmitted
             : Admission::kTooManyOfOrigin;
}

void ConnectionTable::Sweep() {
  for (auto it = connections_.begin(); it != connections_.end();) {
    it = InodeOf(it->first) == it->second.inode ? std::next(it) : Remove(it);
  }
}

ConnectionTable::Connections::iterator ConnectionTable::Remove(
    Connections::iterator connection) {
  const auto count = of_origin_.find(connection->second.origin);
  if (count != of_origin_.end() && --count->second == 0) {
    of_origin_.erase(count);
  }
  return connections_.erase(connection);
}

}  // namespace isomatch
