#pragma once

#include <atomic>
#include <list>
#include <string>
#include <thread>

#include "core/base/file_descriptor.h"
#include "core/base/mutex.h"

namespace isomatch {

/// A port of this machine that leads to a local socket, until a test wants it
/// otherwise: the network between processes, with its faults. Thread-safe.
class DatabaseProxy {
 public:
  enum class Mode {
    kPass,
    kRefuse,  ///< who connects is cut off at once
    kSilent,  ///< nothing arrives, nobody hears of an end: a partition
  };

  /// Begins with kPass. `target`: the path of the socket.
  explicit DatabaseProxy(std::string target);

  /// Cuts all.
  ~DatabaseProxy();

  DatabaseProxy(const DatabaseProxy&) = delete;
  DatabaseProxy& operator=(const DatabaseProxy&) = delete;

  int port() const { return port_; }

  /// What is on its way in kSilent arrives with the next kPass.
  void Set(Mode mode);

  /// Ends all connections that there are, at both ends.
  void CutAll();

 private:
  /// A connection, with the thread that carries its bytes.
  struct Link {
    FileDescriptor client;
    FileDescriptor server;
    std::thread carrier;
    std::atomic<bool> is_cut = false;
    std::atomic<bool> has_ended = false;
  };

  /// What the threads do.
  void Accept();
  void Carry(Link& link);

  void Connect(FileDescriptor client);
  Mode mode();
  /// Returns false when the connection was cut meanwhile.
  bool WaitWhileSilent(const Link& link);
  /// Closes those that have ended.
  void Tidy();

  const std::string target_;
  int port_ = 0;
  FileDescriptor listener_;

  Mutex mutex_;
  CondVar changed_;
  Mode mode_ ABSL_GUARDED_BY(mutex_) = Mode::kPass;
  std::list<Link> links_ ABSL_GUARDED_BY(mutex_);
  std::atomic<bool> is_stopped_ = false;
  std::thread acceptor_;
};

}  // namespace isomatch
