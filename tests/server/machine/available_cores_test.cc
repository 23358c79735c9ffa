#include "server/machine/available_cores.h"

#include <thread>

#include <gtest/gtest.h>

#include "tests/server/machine/fake_root.h"

namespace isomatch {
namespace {

class AvailableCoresTest : public testing::Test {
 protected:
  const FakeRoot root_;
  const int all_ = static_cast<int>(std::thread::hardware_concurrency());
};

TEST_F(AvailableCoresTest, AreAllWithoutALimit) {
  EXPECT_EQ(AvailableCores(root_.path()), all_);
  root_.Write("/proc/self/cgroup", "0::/pod\n");
  root_.Write("/sys/fs/cgroup/pod/cpu.max", "max 100000\n");
  EXPECT_EQ(AvailableCores(root_.path()), all_);
}

TEST_F(AvailableCoresTest, AreTheWholeOnesThatAQuotaHasTimeFor) {
  root_.Write("/proc/self/cgroup", "0::/pod/container\n");
  root_.Write("/sys/fs/cgroup/pod/container/cpu.max", "max 100000\n");
  root_.Write("/sys/fs/cgroup/pod/cpu.max", "190000 100000\n");
  EXPECT_EQ(AvailableCores(root_.path()), 1);
}

TEST_F(AvailableCoresTest, AreAtLeastOne) {
  root_.Write("/proc/self/cgroup", "0::/\n");
  root_.Write("/sys/fs/cgroup/cpu.max", "10000 100000\n");
  EXPECT_EQ(AvailableCores(root_.path()), 1);
}

TEST_F(AvailableCoresTest, FollowVersionOneToo) {
  root_.Write("/proc/self/cgroup", "3:cpu,cpuacct:/docker/abc\n");
  root_.Write("/sys/fs/cgroup/cpu/cpu.cfs_quota_us", "150000\n");
  root_.Write("/sys/fs/cgroup/cpu/cpu.cfs_period_us", "100000\n");
  EXPECT_EQ(AvailableCores(root_.path()), 1);
  root_.Write("/sys/fs/cgroup/cpu/cpu.cfs_quota_us", "-1\n");
  EXPECT_EQ(AvailableCores(root_.path()), all_);
}

}  // namespace
}  // namespace isomatch
