#include "tests/support/memory_growth.h"

#include "server/machine/process_memory.h"

namespace isomatch {

MemoryGrowth::MemoryGrowth() {
  // What others gave back must not serve what is measured.
  ReleaseFreedMemory();
  ResetPeakResidentBytes();
  before_ = ResidentBytes();
}

std::int64_t MemoryGrowth::Bytes() const {
  return PeakResidentBytes() - before_;
}

}  // namespace isomatch
