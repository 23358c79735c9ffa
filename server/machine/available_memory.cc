#include "server/machine/available_memory.h"

#include <algorithm>
#include <fstream>
#include <limits>

#include "absl/strings/numbers.h"
#include "server/machine/cgroup.h"
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

std::int64_t CgroupBytes(const std::string& root) {
  std::int64_t smallest = kNoLimit;
  ForEachCgroup(root, "memory", [&](const std::string& folder, bool is_v2) {
    const char* const file = is_v2 ? "/memory.max" : "/memory.limit_in_bytes";
    smallest = std::min(smallest, ReadLimit(folder + file));
  });
  return smallest;
}

}  // namespace

std::int64_t AvailableMemoryBytes(const std::string& root) {
  const std::int64_t physical =
      ReadProcBytes(root + "/proc/meminfo", "MemTotal").value_or(kNoLimit);
  return std::min(physical, CgroupBytes(root));
}

}  // namespace isomatch
