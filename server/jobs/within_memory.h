#pragma once

#include <new>

#include "absl/time/clock.h"
#include "server/jobs/errors.h"

namespace isomatch {

/// Returns `work()`, an absl::Status or StatusOr; RESOURCE_EXHAUSTED
/// (OUT_OF_MEMORY) when it does not fit in the memory that there is now. For
/// whatever is as large as clients want it: the others are served on.
template <typename Work>
auto WithinMemory(const Work& work) -> decltype(work()) {
  try {
    return work();
  } catch (const std::bad_alloc&) {
    return OutOfMemory();
  }
}

/// Calls `act()`; false when there is no memory for it. For what may be left
/// out.
template <typename Act>
bool IfThereIsMemory(const Act& act) {
  try {
    act();
    return true;
  } catch (const std::bad_alloc&) {
    return false;
  }
}

/// Calls `act()`, again and again for some seconds while there is no memory for
/// it; false when there never was. For what must not be left half done.
/// REQUIRES: act may be called again wherever it ended.
template <typename Act>
bool WhenThereIsMemory(const Act& act) {
  constexpr int kTries = 100;
  constexpr absl::Duration kPause = absl::Milliseconds(100);
  for (int i = 0; i < kTries; ++i) {
    if (IfThereIsMemory(act)) return true;
    absl::SleepFor(kPause);
  }
  return false;
}

}  // namespace isomatch
