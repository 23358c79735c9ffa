#include "server/machine/available_cores.h"

#include <filesystem>
#include <fstream>
#include <string>
#include <thread>

#include <gtest/gtest.h>

#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

/// A file system of its own below the test's temporary directory.
class AvailableCoresTest : public testing::Test {
 protected:
  void Write(const std::string& path, const std::string& text) {
    const std::filesystem::path file = root_ + path;
    std::filesystem::create_directories(file.parent_path());
    std::ofstream(file) << text;
  }

  const TemporaryFolder folder_;
  const std::string root_ = folder_.Path("");
  const int all_ = static_cast<int>(std::thread::hardware_concurrency());
};

TEST_F(AvailableCoresTest, AreAllWithoutALimit) {
  EXPECT_EQ(AvailableCores(root_), all_);
  Write("/proc/self/cgroup", "0::/pod\n");
  Write("/sys/fs/cgroup/pod/cpu.max", "max 100000\n");
  EXPECT_EQ(AvailableCores(root_), all_);
}

TEST_F(AvailableCoresTest, AreTheWholeOnesThatAQuotaHasTimeFor) {
  Write("/proc/self/cgroup", "0::/pod/container\n");
  Write("/sys/fs/cgroup/pod/container/cpu.max", "max 100000\n");
  Write("/sys/fs/cgroup/pod/cpu.max", "190000 100000\n");
  EXPECT_EQ(AvailableCores(root_), 1);
}

TEST_F(AvailableCoresTest, AreAtLeastOne) {
  Write("/proc/self/cgroup", "0::/\n");
  Write("/sys/fs/cgroup/cpu.max", "10000 100000\n");
  EXPECT_EQ(AvailableCores(root_), 1);
}

TEST_F(AvailableCoresTest, FollowVersionOneToo) {
  Write("/proc/self/cgroup", "3:cpu,cpuacct:/docker/abc\n");
  Write("/sys/fs/cgroup/cpu/cpu.cfs_quota_us", "150000\n");
  Write("/sys/fs/cgroup/cpu/cpu.cfs_period_us", "100000\n");
  EXPECT_EQ(AvailableCores(root_), 1);
  Write("/sys/fs/cgroup/cpu/cpu.cfs_quota_us", "-1\n");
  EXPECT_EQ(AvailableCores(root_), all_);
}

}  // namespace
}  // namespace isomatch
