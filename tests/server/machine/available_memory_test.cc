#include "server/machine/available_memory.h"

#include <filesystem>
#include <fstream>
#include <string>

#include <gtest/gtest.h>

#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

/// A file system of its own below the test's temporary directory.
class AvailableMemoryTest : public testing::Test {
 protected:
  void SetUp() override {
    Write("/proc/meminfo", "MemTotal:       1000 kB\nMemFree:  7 kB\n");
  }

  void Write(const std::string& path, const std::string& text) {
    const std::filesystem::path file = root_ + path;
    std::filesystem::create_directories(file.parent_path());
    std::ofstream(file) << text;
  }

  const TemporaryFolder folder_;
  const std::string root_ = folder_.Path("");
};

TEST_F(AvailableMemoryTest, IsThePhysicalMemoryWithoutACgroup) {
  EXPECT_EQ(AvailableMemoryBytes(root_), 1000 * 1024);
}

TEST_F(AvailableMemoryTest, IsTheSmallestLimitOfTheCgroupAndItsAncestors) {
  Write("/proc/self/cgroup", "0::/pod/container\n");
  Write("/sys/fs/cgroup/pod/container/memory.max", "max\n");
  Write("/sys/fs/cgroup/pod/memory.max", "4096\n");
  EXPECT_EQ(AvailableMemoryBytes(root_), 4096);
}

TEST_F(AvailableMemoryTest, IsTheMountsRootWhenTheGroupIsNotVisible) {
  Write("/proc/self/cgroup", "5:cpu:/x\n4:memory:/docker/abc\n");
  Write("/sys/fs/cgroup/memory/memory.limit_in_bytes", "2048\n");
  EXPECT_EQ(AvailableMemoryBytes(root_), 2048);
}

TEST_F(AvailableMemoryTest, OfThisMachineIsPlausible) {
  EXPECT_GT(AvailableMemoryBytes(), 64 << 20);
  EXPECT_LT(AvailableMemoryBytes(), std::int64_t{1} << 46);
}

}  // namespace
}  // namespace isomatch
