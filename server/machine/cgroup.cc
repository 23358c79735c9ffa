#include "server/machine/cgroup.h"

#include <algorithm>
#include <fstream>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"

namespace isomatch {

void ForEachCgroup(
    const std::string& root, const std::string& controller,
    const std::function<void(const std::string& folder, bool is_v2)>& visit) {
  std::ifstream groups(root + "/proc/self/cgroup");
  // Lines are "number:controllers:path"; v2 has no controllers.
  for (std::string line; std::getline(groups, line);) {
    const std::vector<std::string> parts =
        absl::StrSplit(line, absl::MaxSplits(':', 2));
    if (parts.size() != 3) continue;
    const std::vector<std::string> controllers = absl::StrSplit(parts[1], ',');
    const bool is_v2 = parts[1].empty();
    if (!is_v2 && std::find(controllers.begin(), controllers.end(),
                            controller) == controllers.end()) {
      continue;
    }
    const std::string mount =
        absl::StrCat(root, "/sys/fs/cgroup", is_v2 ? "" : "/" + controller);
    std::string group = parts[2];
    while (true) {
      visit(mount + group, is_v2);
      if (group.empty() || group == "/") break;
      group.resize(group.rfind('/'));
    }
  }
}

}  // namespace isomatch
