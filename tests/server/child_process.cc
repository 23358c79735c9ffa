#include "tests/server/child_process.h"

#include <algorithm>
#include <csignal>
#include <utility>

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

namespace isomatch {
namespace {

[[noreturn]] void Execute(const std::string& binary,
                          std::vector<std::string> arguments, int errors,
                          const std::string& output) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);  // also when the test is killed
  dup2(errors, STDERR_FILENO);
  if (!output.empty()) {
    dup2(open(output.c_str(), O_CREAT | O_WRONLY | O_TRUNC, 0600),
         STDOUT_FILENO);
  }
  arguments.insert(arguments.begin(), binary);
  std::vector<char*> pointers;
  for (std::string& argument : arguments) pointers.push_back(argument.data());
  pointers.push_back(nullptr);
  execv(binary.c_str(), pointers.data());
  _exit(127);
}

std::vector<std::string> OnFreePort(std::vector<std::string> flags) {
  const bool is_named =
      std::find(flags.begin(), flags.end(), "--data-dir") != flags.end() ||
      std::find(flags.begin(), flags.end(), "--ephemeral") != flags.end();
  if (!is_named) flags.push_back("--ephemeral");
  flags.insert(flags.end(),
               {"--listen", "127.0.0.1:0", "--metrics-listen", "127.0.0.1:0"});
  return flags;
}

}  // namespace

ChildProcess::ChildProcess(const std::string& binary,
                           std::vector<std::string> arguments,
                           const std::string& output) {
  int ends[2];
  EXPECT_EQ(pipe2(ends, O_CLOEXEC), 0);
  id_ = fork();
  if (id_ == 0) Execute(binary, std::move(arguments), ends[1], output);
  close(ends[1]);
  errors_ = fdopen(ends[0], "r");
}

ChildProcess::~ChildProcess() {
  if (id_ > 0) kill(id_, SIGKILL);
  if (id_ > 0) waitpid(id_, nullptr, 0);
  fclose(errors_);
}

std::string ChildProcess::ReadUntil(const std::string& text) {
  char line[4096];
  while (fgets(line, sizeof(line), errors_) != nullptr) {
    const std::string read = line;
    const size_t at = read.find(text);
    if (at == std::string::npos) continue;
    return read.substr(at + text.size(), read.size() - at - text.size() - 1);
  }
  ADD_FAILURE() << "no line has: " << text;
  return "";
}

std::vector<std::string> ChildProcess::ReadLines() {
  std::vector<std::string> lines;
  char line[4096];
  while (fgets(line, sizeof(line), errors_) != nullptr) {
    lines.emplace_back(line);
    lines.back().pop_back();  // the end of the line
  }
  return lines;
}

void ChildProcess::Signal(int signal) const { kill(id_, signal); }

int ChildProcess::ExitStatus() {
  int status = 0;
  waitpid(id_, &status, 0);
  id_ = 0;
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

ServerProcess::ServerProcess(const std::string& binary,
                             std::vector<std::string> flags)
    : process(binary, OnFreePort(std::move(flags))),
      address(process.ReadUntil("listens on ")) {}

}  // namespace isomatch
