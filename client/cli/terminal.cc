#include "client/cli/terminal.h"

namespace isomatch {

void Tell(const std::vector<std::string>& notes, const Terminal& terminal) {
  for (const std::string& note : notes) terminal.err << note << std::endl;
}

void Warn(const std::vector<std::string>& warnings, const Terminal& terminal) {
  for (const std::string& warning : warnings) {
    terminal.err << "isomatch: warning: " << warning << std::endl;
  }
}

absl::Status Print(const std::string& text, const Terminal& terminal) {
  terminal.out << text << std::flush;
  return terminal.out
             ? absl::OkStatus()
             : absl::UnavailableError("standard output cannot be written");
}

}  // namespace isomatch
