#include <csignal>
#include <ctime>
#include <stop_token>
#include <thread>

#include <unistd.h>

#include "client/cli/command_line.h"

namespace {

// What a command gets to end by itself after Ctrl-C.
constexpr timespec kGrace = {.tv_sec = 5, .tv_nsec = 0};

sigset_t StopSignals() {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGINT);
  sigaddset(&signals, SIGTERM);
  return signals;
}

// The first signal asks the command to stop; a second one, or the end of the
// grace, ends the process. Files are written whole or not at all either way.
void WatchSignals(std::stop_source stop) {  // NOLINT: the thread has its own
  const sigset_t signals = StopSignals();
  int signal = 0;
  sigwait(&signals, &signal);
  stop.request_stop();
  sigtimedwait(&signals, nullptr, &kGrace);
  _exit(isomatch::kExitInterrupted);
}

}  // namespace

int main(int argc, char** argv) {
  std::stop_source stop;
  const sigset_t signals = StopSignals();
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);  // threads inherit it
  // A reader of our output that goes away is an error of writing, not a death.
  std::signal(SIGPIPE, SIG_IGN);
  std::thread(WatchSignals, stop).detach();
  isomatch::Terminal terminal;
  terminal.is_interactive = isatty(STDERR_FILENO) != 0;
  terminal.out_is_terminal = isatty(STDOUT_FILENO) != 0;
  terminal.stop = stop.get_token();
  return isomatch::RunCommandLine(argc, argv, terminal);
}
