#pragma once

#include "client/cli/terminal.h"

namespace isomatch {

/// What the program returns to its caller.
inline constexpr int kExitSuccess = 0;
inline constexpr int kExitFailure = 1;
inline constexpr int kExitUsage = 2;  // wrong usage or input
inline constexpr int kExitInterrupted = 130;

/// Runs `isomatch` with these arguments and returns its exit status. Errors go
/// to terminal.err as one line that begins with "isomatch: ".
int RunCommandLine(int argc, const char* const* argv, const Terminal& terminal);

}  // namespace isomatch
