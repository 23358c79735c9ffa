#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <thread>

#include "absl/base/thread_annotations.h"
#include "absl/status/statusor.h"
#include "core/base/file_descriptor.h"
#include "core/base/mutex.h"
#include "server/rpc/connection_table.h"
#include "server/rpc/listening_sockets.h"
#include "server/rpc/refusals.h"

namespace isomatch {

/// Accepts connections in a thread of its own and hands them over. gRPC 1.51
/// cannot be left to it: once the process has run out of file descriptors, it
/// never accepts again.
///
/// A connection beyond the limits, or for which there is no descriptor, is
/// closed at once, so that its peer knows; a descriptor is kept aside for that.
/// What is refused is logged, one line when refusing begins and one when it
/// ends.
///
/// Thread-safe.
class AcceptLoop {
 public:
  /// Takes over a connected, non-blocking socket, and closes it some day. In
  /// the thread of the loop.
  using HandOver = std::function<void(int socket)>;

  /// Listens, but accepts nothing before Start. Errors of
  /// ListeningSockets::Open; UNAVAILABLE: no descriptor is left.
  static absl::StatusOr<std::unique_ptr<AcceptLoop>> Listen(
      const std::string& address, const ConnectionLimits& limits);

  /// Stop().
  ~AcceptLoop();

  AcceptLoop(const AcceptLoop&) = delete;
  AcceptLoop& operator=(const AcceptLoop&) = delete;

  /// REQUIRES: was not called before.
  void Start(HandOver hand_over);

  /// Returns when nothing is handed over any more. New connections are refused
  /// by the system once this is destroyed. May be called again.
  void Stop();

  /// HOST:PORT, with the port that the system picked where 0 was asked for.
  const std::string& address() const { return sockets_.address(); }

  /// Connections that are open now. Time: O(their number).
  int CountOpen();

  /// Those that were refused since the start.
  std::int64_t refused() const { return refusals_.total(); }

 private:
  AcceptLoop(ListeningSockets sockets, const ConnectionLimits& limits,
             FileDescriptor spare, FileDescriptor stop);
  void Run();
  void WaitForWork();
  bool AcceptSome(int listener);
  bool RefuseOne(int listener);
  void Admit(FileDescriptor socket, const sockaddr_storage& peer);

  const ListeningSockets sockets_;
  HandOver hand_over_;
  /// Closed to have one when there is none left, then opened again.
  FileDescriptor spare_;
  /// Readable when the thread is to end.
  const FileDescriptor stop_;
  std::atomic<bool> is_stopped_ = false;
  Refusals refusals_;
  Mutex mutex_;
  ConnectionTable table_ ABSL_GUARDED_BY(mutex_);
  std::thread thread_;
};

}  // namespace isomatch
