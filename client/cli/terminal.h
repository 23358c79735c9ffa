#pragma once

#include <iostream>
#include <stop_token>
#include <string>
#include <vector>

#include "absl/status/status.h"

namespace isomatch {

/// Where a command reads and writes beside its files.
struct Terminal {
  std::ostream& out = std::cout;
  std::ostream& err = std::cerr;
  /// Whether `err` can draw a progress bar.
  bool is_interactive = false;
  /// Requested when the user wants to stop.
  std::stop_token stop;
  /// Whether `out` is a terminal, too, where a person reads.
  bool out_is_terminal = false;
};

/// Tells the user each of `notes`, one line each, on terminal.err.
void Tell(const std::vector<std::string>& notes, const Terminal& terminal);

/// Tells the user each of `warnings`, one line each.
void Warn(const std::vector<std::string>& warnings, const Terminal& terminal);

/// Writes `text` to terminal.out. UNAVAILABLE when that cannot be written.
absl::Status Print(const std::string& text, const Terminal& terminal);

}  // namespace isomatch
