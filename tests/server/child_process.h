#pragma once

#include <cstdio>
#include <string>
#include <vector>

#include <sys/types.h>

namespace isomatch {

/// A program of ours as a process of its own; what it writes to standard error
/// is read. Killed when it still runs at the end, or when the thread that made
/// it ends. Not thread-safe.
class ChildProcess {
 public:
  /// Starts `binary`; its standard output goes to the file `output`, or where
  /// that of the test goes.
  ChildProcess(const std::string& binary, std::vector<std::string> arguments,
               const std::string& output = "");
  ~ChildProcess();

  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

  /// Reads until a line has `text`; returns what follows it there. Fails the
  /// test when none has.
  std::string ReadUntil(const std::string& text);

  /// Returns the lines that were not read yet, until the end of the output.
  std::vector<std::string> ReadLines();

  void Signal(int signal) const;

  /// 0 after its end.
  pid_t id() const { return id_; }

  /// Waits for its end. -1 when a signal killed it.
  int ExitStatus();

 private:
  pid_t id_ = 0;
  FILE* errors_ = nullptr;
};

/// isomatch-server on free ports, with these flags too, --ephemeral unless they
/// name a --data-dir; `address` is set once it listens.
struct ServerProcess {
  explicit ServerProcess(const std::string& binary,
                         std::vector<std::string> flags = {});

  ChildProcess process;
  std::string address;
};

}  // namespace isomatch
