#include "server/machine/machine.h"

#include "server/machine/available_cores.h"
#include "server/machine/available_memory.h"
#include "server/machine/file_limit.h"

namespace isomatch {

Machine ThisMachine() {
  return {.memory_bytes = AvailableMemoryBytes(),
          .cores = AvailableCores(),
          .files = FileLimit()};
}

}  // namespace isomatch
