#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/base/file_descriptor.h"

namespace isomatch {

/// Sockets that wait for connections, non-blocking. What they accept inherits
/// that small messages are sent at once, and that a peer which does not confirm
/// what was sent for 20 s is gone.
class ListeningSockets {
 public:
  /// Listens on HOST:PORT, on every address that HOST stands for, or on
  /// unix:PATH, where the socket of a server that has ended gives way. 0.0.0.0
  /// and [::] are both all addresses of the machine, of IPv4 and IPv6. Port 0
  /// picks a free one. UNAVAILABLE, naming the address: in use, not of this
  /// machine, no such name.
  static absl::StatusOr<ListeningSockets> Open(const std::string& address);

  ListeningSockets(ListeningSockets&&) = default;
  ListeningSockets& operator=(ListeningSockets&&) = delete;
  /// Stops to listen; the file of a unix socket goes.
  ~ListeningSockets();

  const std::vector<FileDescriptor>& sockets() const { return sockets_; }

  /// What was opened, with the port that was picked.
  const std::string& address() const { return address_; }

 private:
  ListeningSockets() = default;
  absl::Status OpenUnix(const std::string& path);
  absl::Status OpenInet(const std::string& host, const std::string& port);

  std::vector<FileDescriptor> sockets_;
  std::string address_;
  /// Path of the unix socket; empty for other addresses.
  std::string path_;
};

}  // namespace isomatch
