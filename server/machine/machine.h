#pragma once

#include <cstdint>

namespace isomatch {

/// What a process may use.
struct Machine {
  /// See AvailableMemoryBytes.
  std::int64_t memory_bytes = 0;
  /// See AvailableCores.
  int cores = 1;
  /// See FileLimit.
  std::int64_t files = 0;
};

/// Returns what this process may use now.
Machine ThisMachine();

}  // namespace isomatch
