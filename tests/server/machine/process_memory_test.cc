#include "server/machine/process_memory.h"

#include <gtest/gtest.h>

namespace isomatch {
namespace {

TEST(ProcessMemoryTest, ThePeakIsAtLeastWhatIsResident) {
  const std::int64_t resident = ResidentBytes();
  EXPECT_GT(resident, 1 << 20);
  EXPECT_GE(PeakResidentBytes(), resident);
}

}  // namespace
}  // namespace isomatch
