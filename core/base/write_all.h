#pragma once

#include "absl/strings/string_view.h"

namespace isomatch {

/// Writes all of `bytes` to an open file, however often a signal interrupts it.
/// Returns 0, or the system's error number, after which some may be written.
int WriteAll(int file, absl::string_view bytes);

}  // namespace isomatch
