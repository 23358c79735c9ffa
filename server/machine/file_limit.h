#pragma once

#include <cstdint>

namespace isomatch {

/// Allows this process as many open files as it may have, about a million at
/// most. Shells and container engines start programs with 1024, which are for
/// select() and fewer than clients that watch their jobs.
void RaiseFileLimit();

/// How many files this process may have open now.
std::int64_t FileLimit();

/// Who may be connected at the same time.
struct ConnectionLimits {
  int most;
  /// Of one address; 0 for no limit of its own.
  int of_one_address;
};

/// Returns the limits of a server with `files` of FileLimit(): `most` as given,
/// 0 for 10,000, but so many that a quarter of the files, at most 1024, is left
/// for stores and for gRPC itself; `of_one_address` as given, 0 for an eighth
/// of that.
ConnectionLimits ChooseConnectionLimits(int most, int of_one_address,
                                        std::int64_t files);

}  // namespace isomatch
