#pragma once

#include <functional>
#include <string>

namespace isomatch {

/// Calls `visit` with the folder of each cgroup that limits this process: its
/// own and those above it, of v2 and of v1's `controller`. In a container the
/// group's own path may not be visible; the mount's root then stands for it.
/// Folders may not exist. `root` stands before /proc and /sys, for tests.
void ForEachCgroup(
    const std::string& root, const std::string& controller,
    const std::function<void(const std::string& folder, bool is_v2)>& visit);

}  // namespace isomatch
