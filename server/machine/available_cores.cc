#include "server/machine/available_cores.h"

#include <algorithm>
#include <fstream>
#include <thread>

#include "server/machine/cgroup.h"

namespace isomatch {
namespace {

/// A number from a file; not positive when there is none, or no limit.
double ReadNumber(const std::string& path) {
  double number = -1;
  std::ifstream(path) >> number;
  return number;
}

/// Microseconds of processor time in each `period`; not positive for no limit.
struct Quota {
  double time = -1;
  double period = -1;
};

Quota ReadQuota(const std::string& folder, bool is_v2) {
  Quota quota;
  if (is_v2) {
    std::ifstream(folder + "/cpu.max") >> quota.time >> quota.period;
  } else {
    quota.time = ReadNumber(folder + "/cpu.cfs_quota_us");
    quota.period = ReadNumber(folder + "/cpu.cfs_period_us");
  }
  return quota;
}

}  // namespace

int AvailableCores(const std::string& root) {
  double cores = std::max(1u, std::thread::hardware_concurrency());
  ForEachCgroup(root, "cpu", [&](const std::string& folder, bool is_v2) {
    const Quota quota = ReadQuota(folder, is_v2);
    if (quota.time > 0 && quota.period > 0) {
      cores = std::min(cores, quota.time / quota.period);
    }
  });
  return std::max(1, static_cast<int>(cores));
}

}  // namespace isomatch
