#pragma once

#include <string>
#include <thread>
#include <vector>

#include "tests/server/child_process.h"

namespace isomatch {

/// A server whose log is kept. Not thread-safe.
class LoggedProcess {
 public:
  LoggedProcess(const std::string& binary, std::vector<std::string> arguments);
  /// Kills it if it still runs.
  ~LoggedProcess();

  /// Also by itself.
  bool HasEnded() const;

  /// Ends it, also when it was stopped, and returns all that it has logged.
  /// Fails the test when it has ended by itself, or not as `signal` asks it to,
  /// unless it was still starting: then no database is a reason to.
  std::vector<std::string> End(int signal);

  void Signal(int signal) const { process_.Signal(signal); }

 private:
  ChildProcess process_;
  std::vector<std::string> lines_;
  std::thread log_reader_;
};

}  // namespace isomatch
