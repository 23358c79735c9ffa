#include "server/machine/available_memory.h"

#include <algorithm>
#include <fstream>
#include <limits>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"

namespace isomatch {
namespace {

constexpr std::int64_t kNoLimit = std::numeric_limits<std::int64_t>::max();

/// The number a file holds; kNoLimit for "max" or when there is no such file.
std::int64_t ReadLimit(const std::string& path) {
  std::string word;
  std::int64_t limit = 0;
  if (!(std::ifstream(path) >> word)) return kNoLimit;
  return absl::SimpleAtoi(word, &limit) ? limit : kNoLimit;
}

std::int64_t PhysicalBytes(const std::string& root) {
  std::ifstream meminfo(root + "/proc/meminfo");
  std::string key;
  std::int64_t kibibytes = 0;
  while (meminfo >> key) {
    if (key == "MemTotal:" && meminfo >> kibibytes) return kibibytes * 1024;
    meminfo.ignore(std::numeric_limits<std::streamsize>::max(), '\n');
  }
  return kNoLimit;
}

/// The smallest of `file` in the cgroup `group` below `mount` and in all of its
/// ancestors. In a container the group's own path may not be visible; the
/// mount's root then stands for it.
std::int64_t SmallestOfAncestors(const std::string& mount, std::string group,
                                 const std::string& file) {
  std::int64_t smallest = kNoLimit;
  while (true) {
    smallest = std::min(smallest, ReadLimit(absl::StrCat(mount, group, file)));
    if (group.empty() || group == "/") return smallest;
    group.resize(group.rfind('/'));
  }
}

/// Lines of /proc/self/cgroup are "number:controllers:path".
std::int64_t CgroupBytes(const std::string& root) {
  std::int64_t smallest = kNoLimit;
  std::ifstream groups(root + "/proc/self/cgroup");
  for (std::string line; std::getline(groups, line);) {
    const std::vector<std::string> parts =
        absl::StrSplit(line, absl::MaxSplits(':', 2));
    if (parts.size() != 3) continue;
    if (parts[1].empty()) {
      smallest =
          std::min(smallest, SmallestOfAncestors(root + "/sys/fs/cgroup",
                                                 parts[2], "/memory.max"));
    } else if (parts[1] == "memory") {
      smallest = std::min(
          smallest, SmallestOfAncestors(root + "/sys/fs/cgroup/memory",
                                        parts[2], "/memory.limit_in_bytes"));
    }
  }
  return smallest;
}

}  // namespace

std::int64_t AvailableMemoryBytes(const std::string& root) {
  return std::min(PhysicalBytes(root), CgroupBytes(root));
}

std::int64_t ChooseMemoryBudget(std::int64_t wanted_bytes,
                                std::int64_t available_bytes) {
  constexpr double kShare = 0.8;  // the rest is for gRPC, blobs and the system
  const auto most =
      static_cast<std::int64_t>(kShare * static_cast<double>(available_bytes));
  return wanted_bytes == 0 ? most : std::min(wanted_bytes, most);
}

}  // namespace isomatch
