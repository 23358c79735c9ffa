#include "server/machine/machine.h"

#include <algorithm>
#include <thread>

#include "server/machine/available_memory.h"
#include "server/machine/file_limit.h"

namespace isomatch {

Machine ThisMachine() {
  const auto cores = static_cast<int>(std::thread::hardware_concurrency());
  return {.memory_bytes = AvailableMemoryBytes(),
          .cores = std::max(1, cores),
          .files = FileLimit()};
}

}  // namespace isomatch
