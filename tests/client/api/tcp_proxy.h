#pragma once

#include <cstdint>
#include <limits>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

namespace isomatch {

/// Passes bytes between clients and a server on this machine, and fails as
/// networks do when the test says so. Thread-safe.
class TcpProxy {
 public:
  enum Direction { kToServer, kToClient };

  /// `target` is 127.0.0.1:PORT of the server.
  explicit TcpProxy(const std::string& target);
  ~TcpProxy();

  TcpProxy(const TcpProxy&) = delete;
  TcpProxy& operator=(const TcpProxy&) = delete;

  /// 127.0.0.1:PORT for clients.
  std::string address() const;

  /// Ends all connections; new ones are accepted.
  void Cut();

  /// Cuts once, when this many bytes more have passed.
  void CutAfter(Direction direction, std::int64_t bytes);

  /// From now on new connections are ended at once.
  void RefuseAll();

  std::int64_t bytes_passed(Direction direction) const;
  int cuts() const;

 private:
  void Accept();
  void Pump(int from, int to, Direction direction);
  bool Count(Direction direction, std::int64_t bytes);
  void CutLocked();

  const int target_port_;
  int listener_ = -1;
  int port_ = 0;

  mutable std::mutex mutex_;
  std::vector<int> sockets_;
  std::vector<std::jthread> pumps_;
  std::int64_t passed_[2] = {0, 0};
  std::int64_t cut_at_[2] = {std::numeric_limits<std::int64_t>::max(),
                             std::numeric_limits<std::int64_t>::max()};
  int cuts_ = 0;
  bool refuses_ = false;
  std::jthread accept_;
};

}  // namespace isomatch
