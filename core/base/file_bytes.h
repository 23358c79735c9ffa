#pragma once

#include <cstddef>
#include <string>

#include "absl/strings/string_view.h"

namespace isomatch {

/// Writes all of `bytes` to an open file, however often a signal interrupts it.
/// Returns 0, or the system's error number, after which some may be written.
int WriteAll(int file, absl::string_view bytes);

/// Reads the next `most` bytes of an open file, or those there are, into
/// `bytes`. Returns 0, or the system's error number.
int ReadUpTo(std::size_t most, int file, std::string* bytes);

}  // namespace isomatch
