#pragma once

#include <chrono>
#include <string>
#include <unordered_map>

#include <sys/socket.h>
#include <sys/types.h>

namespace isomatch {

/// Who may be connected at the same time.
struct ConnectionLimits {
  int most;
  /// Connections from one address; 0 for no limit of its own.
  int of_one_address;
};

/// Returns whom connections of a peer are counted for: its IPv4 address, or the
/// first 64 bits of its IPv6 address, which is what one customer of a network
/// gets. Empty, for which there is no limit, on this machine: loopback and unix
/// sockets, where a proxy or the user himself calls.
std::string OriginOf(const sockaddr_storage& peer);

/// Which connections are open, of sockets that somebody else closes. A number
/// of a file that is no longer the same socket is an ended connection; that is
/// looked up only when a limit seems to be reached. Not thread-safe.
class ConnectionTable {
 public:
  explicit ConnectionTable(const ConnectionLimits& limits) : limits_(limits) {}

  enum class Admission {
    kAdmitted,  ///< counted from now on
    kTooMany,   ///< there are limits.most
    kTooManyOfOrigin,
  };

  using Clock = std::chrono::steady_clock;

  /// Time: constant, and O(open connections) at most 50 times a second; so a
  /// connection that ended within the last 20 ms may still count.
  Admission Admit(int socket, const std::string& origin, Clock::time_point now);

  /// Open connections. Time: O(open connections).
  int CountOpen();

 private:
  struct Connection {
    ino_t inode;
    std::string origin;
  };
  using Connections = std::unordered_map<int, Connection>;

  Admission Judge(const std::string& origin) const;
  void Sweep();
  Connections::iterator Remove(Connections::iterator connection);

  const ConnectionLimits limits_;
  /// By the number of the file.
  Connections connections_;
  /// How many there are of each origin but the empty one.
  std::unordered_map<std::string, int> of_origin_;
  Clock::time_point last_sweep_ = Clock::time_point::min();
};

}  // namespace isomatch
