#include "server/machine/proc_file.h"

#include <fstream>
#include <optional>
#include <string>

#include <gtest/gtest.h>

#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

TEST(ProcFileTest, SaysTheBytesOfTheLineOfAKey) {
  const TemporaryFolder folder;
  const std::string path = folder.Path("status");
  std::ofstream(path) << "Name:\tisomatch VmHWM: 1 kB\n"
                         "VmHWM2:\t       2 kB\n"
                         "VmHWM:\t       3 kB\n";
  EXPECT_EQ(ReadProcBytes(path, "VmHWM"), 3 * 1024);
  EXPECT_EQ(ReadProcBytes(path, "Vm"), std::nullopt);
  EXPECT_EQ(ReadProcBytes(path, "Name"), std::nullopt);
  EXPECT_EQ(ReadProcBytes(folder.Path("missing"), "VmHWM"), std::nullopt);
}

}  // namespace
}  // namespace isomatch
