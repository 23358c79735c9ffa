#include "server/machine/available_memory.h"

#include <gtest/gtest.h>

#include "tests/server/machine/fake_root.h"

namespace isomatch {
namespace {

class AvailableMemoryTest : public testing::Test {
 protected:
  void SetUp() override {
    root_.Write("/proc/meminfo", "MemTotal:       1000 kB\nMemFree:  7 kB\n");
  }

  const FakeRoot root_;
};

TEST_F(AvailableMemoryTest, IsThePhysicalMemoryWithoutACgroup) {
  EXPECT_EQ(AvailableMemoryBytes(root_.path()), 1000 * 1024);
}

TEST_F(AvailableMemoryTest, IsTheSmallestLimitOfTheCgroupAndItsAncestors) {
  root_.Write("/proc/self/cgroup", "0::/pod/container\n");
  root_.Write("/sys/fs/cgroup/pod/container/memory.max", "max\n");
  root_.Write("/sys/fs/cgroup/pod/memory.max", "4096\n");
  EXPECT_EQ(AvailableMemoryBytes(root_.path()), 4096);
}

TEST_F(AvailableMemoryTest, IsTheMountsRootWhenTheGroupIsNotVisible) {
  root_.Write("/proc/self/cgroup", "5:cpu:/x\n4:memory:/docker/abc\n");
  root_.Write("/sys/fs/cgroup/memory/memory.limit_in_bytes", "2048\n");
  EXPECT_EQ(AvailableMemoryBytes(root_.path()), 2048);
}

TEST_F(AvailableMemoryTest, OfThisMachineIsPlausible) {
  EXPECT_GT(AvailableMemoryBytes(), 64 << 20);
  EXPECT_LT(AvailableMemoryBytes(), std::int64_t{1} << 46);
}

}  // namespace
}  // namespace isomatch
