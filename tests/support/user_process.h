#pragma once

#include <string>
#include <vector>

#include <sys/types.h>

#include "absl/status/statusor.h"

namespace isomatch {

/// A program that refuses to run as root, and where it reads and writes.
struct UserCommand {
  std::vector<std::string> words;
  std::string input = "/dev/null";
  /// A file, which it continues; also for its errors.
  std::string output = "/dev/null";
};

/// Starts a program, which takes root for an ordinary user, and returns its
/// process. It gets SIGQUIT when this thread ends. INTERNAL: the kernel's
/// error.
absl::StatusOr<pid_t> SpawnAsUser(UserCommand command);

/// Returns the path of a program in PATH or in `folder`. NOT_FOUND: which
/// Debian package is missing.
absl::StatusOr<std::string> FindProgram(const std::string& name,
                                        const std::string& folder,
                                        const std::string& package);

/// What is in a file; empty when there is none.
std::string TextOf(const std::string& path);

}  // namespace isomatch
