#pragma once

#include <cstdint>

namespace isomatch {

/// Allows this process as many open files as it may have, about a million at
/// most. Shells and container engines start programs with 1024, which are for
/// select() and fewer than clients that watch their jobs.
void RaiseFileLimit();

/// How many files this process may have open now.
std::int64_t FileLimit();

}  // namespace isomatch
