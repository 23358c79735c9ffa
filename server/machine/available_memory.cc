#include "server/machine/available_memory.h"

#include <algorithm>
#include <fstream>
#include <limits>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "server/machine/proc_file.h"

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
  const std::int64_t physical =
      ReadProcBytes(root + "/proc/meminfo", "MemTotal").value_or(kNoLimit);
  return std::min(physical, CgroupBytes(root));
}

}  // namespace isomatch
