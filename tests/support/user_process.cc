#include "tests/support/user_process.h"

#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>

#include <fcntl.h>
#include <sched.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"

namespace isomatch {
namespace {

// What a forked child does before it becomes another program: system calls
// only, since other threads may hold locks of the library.

[[noreturn]] void Give(const char* what) {
  const char* const why = std::strerror(errno);
  for (const char* text : {"cannot ", what, ": ", why, "\n"}) {
    (void)!write(STDERR_FILENO, text, std::strlen(text));
  }
  _exit(126);
}

void WriteTo(const char* path, const char* text) {
  const int file = open(path, O_WRONLY | O_CLOEXEC);
  if (file < 0 || write(file, text, std::strlen(text)) < 0) Give(path);
  close(file);
}

/// Calls root 1000, in the new user namespace of this process.
void RenameRoot() {
  WriteTo("/proc/self/setgroups", "deny");
  WriteTo("/proc/self/uid_map", "1000 0 1");
  WriteTo("/proc/self/gid_map", "1000 0 1");
}

void Redirect(const std::string& path, int flags, int to) {
  if (dup2(open(path.c_str(), flags | O_CLOEXEC, 0600), to) < 0) Give("open");
}

}  // namespace

absl::StatusOr<pid_t> SpawnAsUser(UserCommand command) {
  std::vector<char*> words;
  for (std::string& word : command.words) words.push_back(word.data());
  words.push_back(nullptr);
  const pid_t parent = getpid();
  // Not fork and unshare: ThreadSanitizer gives a forked child a second thread,
  // which unshare refuses.
  const bool is_root = geteuid() == 0;
  const auto child = static_cast<pid_t>(
      syscall(SYS_clone, SIGCHLD | (is_root ? CLONE_NEWUSER : 0), nullptr,
              nullptr, nullptr, nullptr));
  if (child < 0) {
    return absl::InternalError(absl::StrCat(
        "no process for ", command.words[0], ": ", std::strerror(errno),
        is_root ? "; be no root, or allow user namespaces" : ""));
  }
  if (child > 0) return child;
  Redirect(command.input, O_RDONLY, STDIN_FILENO);
  Redirect(command.output, O_CREAT | O_WRONLY | O_APPEND, STDOUT_FILENO);
  Redirect(command.output, O_CREAT | O_WRONLY | O_APPEND, STDERR_FILENO);
  if (is_root) RenameRoot();
  prctl(PR_SET_PDEATHSIG, SIGQUIT);
  if (getppid() != parent) _exit(125);
  execv(words[0], words.data());
  Give(words[0]);
}

absl::StatusOr<std::string> FindProgram(const std::string& name,
                                        const std::string& folder,
                                        const std::string& package) {
  const char* const path = std::getenv("PATH");
  std::vector<std::string> folders =
      absl::StrSplit(path == nullptr ? "" : path, ':', absl::SkipEmpty());
  folders.push_back(folder);
  for (const std::string& each : folders) {
    std::string program = absl::StrCat(each, "/", name);
    if (access(program.c_str(), X_OK) == 0) return program;
  }
  return absl::NotFoundError(absl::StrCat(
      "no program ", name, " in PATH or ", folder,
      ": install the Debian package ", package, " (docker/packages.txt)"));
}

std::string TextOf(const std::string& path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), {}};
}

}  // namespace isomatch
