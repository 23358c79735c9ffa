#pragma once

#include <sstream>
#include <stop_token>
#include <string>
#include <vector>

#include "client/cli/command_line.h"

namespace isomatch {

/// What a run of `isomatch` left.
struct CommandOutcome {
  int status;
  std::string out;
  std::string err;
};

/// Runs `isomatch` with these arguments in this process.
inline CommandOutcome RunIsomatch(std::vector<std::string> arguments,
                                  const std::stop_token& stop = {}) {
  arguments.insert(arguments.begin(), "isomatch");
  std::vector<const char*> argv;
  argv.reserve(arguments.size());
  for (const std::string& argument : arguments) {
    argv.push_back(argument.c_str());
  }
  std::ostringstream out;
  std::ostringstream err;
  const Terminal terminal{out, err, false, stop};
  const int status =
      RunCommandLine(static_cast<int>(argv.size()), argv.data(), terminal);
  return {status, out.str(), err.str()};
}

}  // namespace isomatch
