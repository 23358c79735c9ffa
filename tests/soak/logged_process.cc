#include "tests/soak/logged_process.h"

#include <algorithm>
#include <csignal>
#include <utility>

#include <gtest/gtest.h>
#include <sys/wait.h>

#include "absl/strings/match.h"
#include "absl/strings/str_join.h"

namespace isomatch {
namespace {

/// Whether a server has come so far that it says what it does.
bool IsReady(const std::vector<std::string>& lines) {
  return std::ranges::any_of(lines, [](const std::string& line) {
    return absl::StrContains(line, " listens on ") ||
           absl::StrContains(line, " runs jobs of ");
  });
}

std::string Last(const std::vector<std::string>& lines) {
  const auto count = std::min<std::ptrdiff_t>(std::ssize(lines), 20);
  return absl::StrJoin(lines.end() - count, lines.end(), "\n");
}

}  // namespace

LoggedProcess::LoggedProcess(const std::string& binary,
                             std::vector<std::string> arguments)
    : process_(binary, std::move(arguments)),
      log_reader_([this] { lines_ = process_.ReadLines(); }) {}

LoggedProcess::~LoggedProcess() {
  if (!log_reader_.joinable()) return;
  Signal(SIGKILL);
  process_.ExitStatus();
  log_reader_.join();
}

bool LoggedProcess::HasEnded() const {
  siginfo_t ended = {};
  waitid(P_PID, static_cast<id_t>(process_.id()), &ended,
         WEXITED | WNOHANG | WNOWAIT);
  return ended.si_pid == process_.id();
}

std::vector<std::string> LoggedProcess::End(int signal) {
  const bool has_ended = HasEnded();
  Signal(signal);
  Signal(SIGCONT);
  const int status = process_.ExitStatus();
  log_reader_.join();
  if (IsReady(lines_)) {
    EXPECT_FALSE(has_ended) << "a server has ended by itself:\n"
                            << Last(lines_);
    EXPECT_EQ(status, signal == SIGTERM ? 0 : -1) << Last(lines_);
  }
  return std::move(lines_);
}

}  // namespace isomatch
