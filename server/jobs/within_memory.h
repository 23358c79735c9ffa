#pragma once

#include <new>

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

}  // namespace isomatch
